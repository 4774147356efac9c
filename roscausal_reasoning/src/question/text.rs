//! Actions and limits as a user types them.

use roscausal_discovery::ensure;

use super::{Action, GO_ON, Intervention, Kind, Limit};

/// Reads an action: `stop: r_v=0@1..10`, `slow: r_v+=-0.3, h_v=0.5@2`, `ramp: r_v=0.6|0.4|0.2@1..3`, `go on`. A name, then what is set
/// (`=`) or shifted (`+=`), at which steps (default: all). Without a name the text itself is the name.
///
/// ```
/// use roscausal_reasoning::question::{Kind, parse_action};
///
/// let action = parse_action("stop: r_v=0@1..10").unwrap();
/// let stop = &action.interventions[0];
/// assert_eq!((action.name.as_str(), stop.kind, stop.last_step), ("stop", Kind::Set, 10));
/// ```
///
/// # Errors
/// One sentence: what cannot be read, and an example.
pub fn parse_action(text: &str) -> Result<Action, String> {
    let text = text.trim();
    if text.eq_ignore_ascii_case(GO_ON) {
        return Ok(Action::go_on());
    }
    let (name, body) = text.split_once(':').map_or((text, text), |(name, body)| (name.trim(), body));
    let parts = body.split(',').map(str::trim).filter(|part| !part.is_empty());
    let interventions = parts.map(intervention).collect::<Result<Vec<_>, _>>()?;
    Ok(Action { name: name.to_owned(), interventions })
}

fn intervention(text: &str) -> Result<Intervention, String> {
    let fault = || format!("'{text}' is not an intervention; write it like r_v=0@1..10 or r_v+=-0.2");
    let (left, right) = text.split_once('=').ok_or_else(fault)?;
    let (variable, kind) = match left.trim_end().strip_suffix('+') {
        Some(variable) => (variable.trim(), Kind::Shift),
        None => (left.trim(), Kind::Set),
    };
    let (values, steps) = match right.split_once('@') {
        Some((values, steps)) => (values, Some(steps.trim())),
        None => (right, None),
    };
    let values = values.split('|').map(|value| value.trim().parse::<f64>()).collect::<Result<Vec<_>, _>>();
    let step = |text: &str| text.trim().parse::<usize>().map_err(|_| fault());
    let (first_step, last_step) = match steps.map(|steps| steps.split_once("..").ok_or(steps)) {
        None => (1, 0),
        // Among the settings 0 stands for the end of the question.
        Some(Ok((first, last))) => match (step(first)?, step(last)?) {
            (_, 0) => return Err(fault()),
            steps => steps,
        },
        Some(Err(one)) => (step(one)?, step(one)?),
    };
    ensure(!variable.is_empty(), fault)?;
    let values = values.map_err(|_| fault())?;
    Ok(Intervention::new(kind, variable.to_owned(), values).during(first_step, last_step))
}

/// Reads a limit: `d>1.5:0.95`, `h_risk<2`. A variable, the bound that it is to stay above or below, and the probability (default 0.95).
///
/// # Errors
/// One sentence: what cannot be read, and an example.
pub fn parse_limit(text: &str) -> Result<Limit, String> {
    let fault = || format!("'{text}' is not a limit; write it like d>1.5:0.95 or h_risk<2");
    let (bound, probability) = match text.split_once(':') {
        Some((bound, probability)) => (bound, probability.trim().parse().map_err(|_| fault())?),
        None => (text, 0.95),
    };
    let (at, sign) = bound.char_indices().find(|(_, c)| matches!(c, '<' | '>')).ok_or_else(fault)?;
    let value: f64 = bound[at + 1..].trim().parse().map_err(|_| fault())?;
    let variable = bound[..at].trim().to_owned();
    ensure(!variable.is_empty(), fault)?;
    let (above, below) = if sign == '>' { (Some(value), None) } else { (None, Some(value)) };
    Ok(Limit { variable, above, below, probability })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actions_are_read_as_they_are_written() {
        let action = parse_action("slow: r_v += -0.3, h_v=0.5@2, d=1|2|3@4..6").unwrap();
        let steps: Vec<_> = action.interventions.iter().map(|one| (one.first_step, one.last_step)).collect();
        assert_eq!((action.name.as_str(), &steps[..]), ("slow", &[(1, 0), (2, 2), (4, 6)][..]));
        assert_eq!(
            (action.interventions[0].kind, &action.interventions[2].values[..]),
            (Kind::Shift, &[1.0, 2.0, 3.0][..])
        );
        assert_eq!(parse_action("r_v=0").unwrap().name, "r_v=0");
        assert_eq!(parse_action("Go on").unwrap(), Action::go_on());
    }

    #[test]
    fn what_cannot_be_read_is_refused_with_an_example() {
        for text in ["stop: r_v", "=3", "a=x", "a=1@x", "a=1@1..", "a=1@-1", "a=1@5..0"] {
            assert!(parse_action(text).unwrap_err().contains("r_v=0@1..10"), "{text}");
        }
        for text in ["d", "d>x", ">1", "d>1:p"] {
            assert!(parse_limit(text).unwrap_err().contains("d>1.5:0.95"), "{text}");
        }
        assert_eq!(parse_limit("d > 1.5").unwrap().above, Some(1.5));
        assert_eq!(parse_limit("h_risk<2:0.5").unwrap().probability, 0.5);
    }
}
