//! Driving the first person from the keyboard, with a small map in the terminal, on any middleware.
//!
//! Out: `/ped/control/cmd_vel`, `twist_mux/scaling_factor`, `/hri/control`. In, for the map:
//! `/ped/control/teleop_persons`, `/robot_pose`, `/hri/human_goals`, `/pedsim_simulator/simulated_agents`.

use std::{
    io::{IsTerminal, Write},
    time::{Duration, Instant},
};

use crossterm::{
    cursor,
    event::{self, Event as TerminalEvent, KeyCode, KeyEvent, KeyEventKind, KeyModifiers},
    queue,
    style::Print,
    terminal,
};
use roscausal_core::{
    Error, Result,
    inbox::{Inbox, Next},
    middleware::{Middleware, Publish, Qos},
};
use roscausal_msgs::{
    geometry_msgs::{Pose, PoseWithCovarianceStamped, Twist, Vector3},
    pedsim_msgs::{AgentStates, TrackedPersons},
    std_msgs::{Float64, String as Text},
};

use crate::{geometry::Vec2, person::Teleop};

/// Speeds set by the keys, m/s and rad/s.
const FORWARD: f64 = 1.5;
const TURN: f64 = 1.0;
/// Half the side of the map, metres, and its maximum number of rows.
const HALF: f64 = 10.5;
const ROWS: usize = 32;
const REDRAW: Duration = Duration::from_millis(100);
const KEYS: [&str; 9] = [
    "arrows or i j k l , drive",
    "k/space stop",
    "a s d robot speed 0.5 1 2",
    "p pause",
    "r resume",
    "n step",
    "0 reset",
    "o the person walks alone",
    "q quit",
];

/// What a key does.
#[derive(Clone, Debug, PartialEq)]
enum Action {
    /// The person walks like this from now on.
    Drive(Teleop),
    /// Scales the robots' speeds.
    Scale(f64),
    /// A command for the simulator.
    Control(&'static str),
    Quit,
}

/// The action of a key while the person walks as `now`; `None` for keys without a meaning.
fn action(key: KeyEvent, now: Teleop) -> Option<Action> {
    use Action::{Control, Drive, Quit, Scale};
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return (key.code == KeyCode::Char('c')).then_some(Quit);
    }
    Some(match key.code {
        KeyCode::Up | KeyCode::Char('i') => Drive(Teleop { v: FORWARD, omega: 0.0 }),
        KeyCode::Down | KeyCode::Char(',') => Drive(Teleop { v: -FORWARD / 2.0, omega: 0.0 }),
        KeyCode::Left | KeyCode::Char('j') => Drive(Teleop { omega: TURN, ..now }),
        KeyCode::Right | KeyCode::Char('l') => Drive(Teleop { omega: -TURN, ..now }),
        KeyCode::Char('k' | ' ') => Drive(Teleop::default()),
        KeyCode::Char('a') => Scale(0.5),
        KeyCode::Char('s') => Scale(1.0),
        KeyCode::Char('d') => Scale(2.0),
        KeyCode::Char('p') => Control("pause"),
        KeyCode::Char('r') => Control("resume"),
        KeyCode::Char('n') => Control("step"),
        KeyCode::Char('0') => Control("reset"),
        KeyCode::Char('o') => Control("autonomous"),
        KeyCode::Char('q') | KeyCode::Esc => Quit,
        _ => return None,
    })
}

/// What the map shows.
#[derive(Clone, Debug, Default, PartialEq)]
struct View {
    people: Vec<Vec2>,
    goals: Vec<Vec2>,
    crowd: Vec<Vec2>,
    robot: Option<Vec2>,
}

impl View {
    /// The map as `rows` lines of text in a frame: `P` people, `x` goals, `R` the robot, `o` pedestrians.
    fn lines(&self, rows: usize) -> Vec<String> {
        // a character is about twice as high as wide
        let columns = 2 * rows;
        let mut map = vec![vec![' '; columns]; rows];
        let mut mark = |place: &Vec2, sign: char| {
            let column = (place.x + HALF) / (2.0 * HALF) * columns as f64;
            let row = (HALF - place.y) / (2.0 * HALF) * rows as f64;
            // Casts saturate: whoever is outside the map, or has no position, is not drawn.
            if column >= 0.0
                && row >= 0.0
                && let Some(cell) = map.get_mut(row as usize).and_then(|row| row.get_mut(column as usize))
            {
                *cell = sign;
            }
        };
        self.goals.iter().for_each(|place| mark(place, 'x'));
        self.crowd.iter().for_each(|place| mark(place, 'o'));
        self.robot.iter().for_each(|place| mark(place, 'R'));
        self.people.iter().for_each(|place| mark(place, 'P'));
        let edge = format!("+{}+", "-".repeat(columns));
        let rows = map.into_iter().map(|row| format!("|{}|", row.into_iter().collect::<String>()));
        std::iter::once(edge.clone()).chain(rows).chain([edge]).collect()
    }
}

/// Everything on a terminal of `columns` and `rows`: the map as large as fits, `status`, and the keys.
fn picture(view: &View, status: String, columns: usize, rows: usize) -> Vec<String> {
    let mut keys: Vec<String> = Vec::new();
    for key in KEYS {
        match keys.last_mut().filter(|line| line.len() + 3 + key.len() <= columns) {
            Some(line) => line.extend(["   ", key]),
            None => keys.push(key.to_owned()),
        }
    }
    // frame and status
    let room = rows.saturating_sub(keys.len() + 3).min(columns.saturating_sub(2) / 2);
    let mut lines = view.lines(room.min(ROWS));
    lines.push(status);
    lines.extend(keys);
    lines
}

enum Event {
    People(Vec<Vec2>),
    Goals(Vec<Vec2>),
    Crowd(Vec<Vec2>),
    Robot(Vec2),
}

/// Raw mode and an alternate screen, for as long as it lives.
struct Screen;

impl Screen {
    fn open() -> Result<Self> {
        let fault = |e: std::io::Error| Error::Data(format!("the terminal cannot be used for driving: {e}"));
        terminal::enable_raw_mode().map_err(fault)?;
        let screen = Self;
        queue!(std::io::stdout(), terminal::EnterAlternateScreen, cursor::Hide).map_err(fault)?;
        Ok(screen)
    }

    fn draw(lines: &[String]) -> std::io::Result<()> {
        let mut out = std::io::stdout();
        let rest = terminal::Clear(terminal::ClearType::UntilNewLine);
        for (row, line) in lines.iter().enumerate() {
            let row = u16::try_from(row).unwrap_or(u16::MAX);
            queue!(out, cursor::MoveTo(0, row), Print(line), rest)?;
        }
        queue!(out, terminal::Clear(terminal::ClearType::FromCursorDown))?;
        out.flush()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = queue!(std::io::stdout(), cursor::Show, terminal::LeaveAlternateScreen);
        let _ = std::io::stdout().flush();
        let _ = terminal::disable_raw_mode();
    }
}

/// Drives until `q` is pressed or the middleware ends.
///
/// # Errors
/// No terminal, or a topic that the middleware refuses.
pub fn teleop<M: Middleware>(mw: &M) -> Result<()> {
    let reason = "driving needs a terminal: start it in one, without pipes";
    Error::ensure_data(std::io::stdin().is_terminal() && std::io::stdout().is_terminal(), || reason)?;
    let qos = Qos::Volatile(10);
    let drive = mw.advertise::<Twist>("/ped/control/cmd_vel", qos)?;
    let scale = mw.advertise::<Float64>("twist_mux/scaling_factor", qos)?;
    let control = mw.advertise::<Text>("/hri/control", qos)?;
    let inbox = Inbox::detached(mw, 100);
    let _inputs = subscribe(mw, &inbox)?;
    let _screen = Screen::open()?;
    let fault = |e: std::io::Error| Error::Data(format!("the terminal is gone: {e}"));
    let (mut view, mut now, mut stated) = (View::default(), Teleop::default(), String::new());
    let mut drawn: Option<Instant> = None;
    while mw.is_ok() {
        while let Next::Event(event) = inbox.next(mw, Some(mw.now())) {
            match event {
                Event::People(people) => view.people = people,
                Event::Goals(goals) => view.goals = goals,
                Event::Crowd(crowd) => view.crowd = crowd,
                Event::Robot(robot) => view.robot = Some(robot),
            }
        }
        if drawn.is_none_or(|drawn| drawn.elapsed() >= REDRAW) {
            drawn = Some(Instant::now());
            let (columns, rows) = terminal::size().map_err(fault)?;
            let status = format!("{:.1} m/s  {:+.1} rad/s  {stated}", now.v, now.omega);
            Screen::draw(&picture(&view, status, columns.into(), rows.into())).map_err(fault)?;
        }
        if !event::poll(REDRAW / 5).map_err(fault)? {
            continue;
        }
        let TerminalEvent::Key(key) = event::read().map_err(fault)? else { continue };
        if key.kind == KeyEventKind::Release {
            continue;
        }
        match action(key, now) {
            None => {}
            Some(Action::Quit) => return Ok(()),
            Some(Action::Drive(wish)) => {
                now = wish;
                let mut twist = Twist { linear: Vector3 { x: wish.v, y: 0.0, z: 0.0 }, ..Twist::default() };
                twist.angular.z = wish.omega;
                drive.publish(&twist)?;
                stated = "you drive".into();
            }
            Some(Action::Scale(factor)) => {
                scale.publish(&Float64 { data: factor })?;
                stated = format!("robot speed x {factor}");
            }
            Some(Action::Control(word)) => {
                control.publish(&Text { data: word.to_owned() })?;
                stated = word.to_owned();
            }
        }
    }
    Ok(())
}

fn subscribe<M: Middleware>(mw: &M, inbox: &Inbox<Event>) -> Result<Vec<M::Subscription>> {
    let qos = Qos::Volatile(10);
    let at = |pose: Pose| Vec2::new(pose.position.x, pose.position.y);
    let places = move |m: TrackedPersons| m.tracks.into_iter().map(|t| at(t.pose.pose)).collect::<Vec<_>>();
    let crowd = move |m: AgentStates| Event::Crowd(m.agent_states.into_iter().map(|a| at(a.pose)).collect());
    let robot = move |m: PoseWithCovarianceStamped| Event::Robot(at(m.pose.pose));
    Ok(vec![
        inbox.subscribe(mw, "/ped/control/teleop_persons", qos, move |m| Event::People(places(m)))?,
        inbox.subscribe(mw, "/hri/human_goals", Qos::Latched, move |m| Event::Goals(places(m)))?,
        inbox.subscribe(mw, "/pedsim_simulator/simulated_agents", qos, crowd)?,
        inbox.subscribe(mw, "/robot_pose", qos, robot)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(code: KeyCode, now: Teleop) -> Option<Action> {
        action(KeyEvent::new(code, KeyModifiers::NONE), now)
    }

    #[test]
    fn arrows_and_letters_drive_and_turning_keeps_the_speed() {
        let ahead = Teleop { v: FORWARD, omega: 0.0 };
        for (arrow, letter) in
            [(KeyCode::Up, 'i'), (KeyCode::Down, ','), (KeyCode::Left, 'j'), (KeyCode::Right, 'l')]
        {
            assert_eq!(press(arrow, ahead), press(KeyCode::Char(letter), ahead));
        }
        assert_eq!(press(KeyCode::Up, Teleop::default()), Some(Action::Drive(ahead)));
        assert_eq!(press(KeyCode::Left, ahead), Some(Action::Drive(Teleop { v: FORWARD, omega: TURN })));
        assert_eq!(press(KeyCode::Char('k'), ahead), Some(Action::Drive(Teleop::default())));
    }

    #[test]
    fn the_originals_keys_scale_the_robots_speed_and_others_do_nothing() {
        for (key, factor) in [('a', 0.5), ('s', 1.0), ('d', 2.0)] {
            assert_eq!(press(KeyCode::Char(key), Teleop::default()), Some(Action::Scale(factor)));
        }
        assert_eq!(press(KeyCode::Char('z'), Teleop::default()), None);
        let control_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(action(control_c, Teleop::default()), Some(Action::Quit));
    }

    #[test]
    fn the_map_shows_who_is_where_and_nobody_outside() {
        let view = View {
            people: vec![Vec2::ZERO, Vec2::new(f64::NAN, 0.0), Vec2::new(1e9, -1e9)],
            goals: vec![Vec2::new(-10.0, 10.0)],
            crowd: vec![Vec2::new(10.0, -10.0)],
            robot: Some(Vec2::new(5.0, 0.0)),
        };
        let lines = view.lines(ROWS);
        assert_eq!((lines.len(), lines[0].len()), (ROWS + 2, 2 * ROWS + 2));
        assert_eq!(lines.concat().matches('P').count(), 1);
        assert_eq!((lines[1].find('x'), lines[ROWS].find('o')), (Some(2), Some(63)));
        assert!(lines[ROWS / 2 + 1].find('P') < lines[ROWS / 2 + 1].find('R'));
    }

    #[test]
    fn the_picture_fits_any_terminal() {
        for (columns, rows) in [(80, 24), (200, 60), (50, 12), (30, 20), (80, 5), (1, 1)] {
            let lines = picture(&View::default(), "0.0 m/s".into(), columns, rows);
            assert!(lines.len() <= rows.max(KEYS.len() + 3), "{columns} x {rows}: {lines:#?}");
            let widest = KEYS.iter().map(|key| key.len()).max().unwrap_or(0);
            assert!(
                lines.iter().all(|line| line.len() <= columns.max(widest)),
                "{columns} x {rows}: {lines:#?}"
            );
            assert!(KEYS.iter().all(|key| lines.iter().any(|line| line.contains(key))), "{lines:#?}");
        }
        assert!(picture(&View::default(), String::new(), 80, 24).len() > 20);
    }
}
