//! `--web`: the live page of a run.

use std::{net::IpAddr, thread, time::Duration};

use clap::Args as ClapArgs;
use roscausal_core::{Result, loopback::Loopback, nodes::SceneOptions};
use roscausal_dashboard::{Server, Teller, dashboard};

use crate::{interrupt::Interrupt, nodes::Threaded};

/// Time between two checks whether to end.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// Arguments of the live page.
#[derive(ClapArgs, Clone, Debug)]
#[command(next_help_heading = "Nodes and page")]
pub(crate) struct WebArgs {
    /// Show the run live on a page in the browser; Ctrl-C ends it.
    #[arg(long)]
    pub(crate) web: bool,
    /// Port of the page; 0: any free port.
    #[arg(long, default_value_t = 8321, requires = "web")]
    port: u16,
    /// Address to serve the page on; an address other than this machine's own requires a token.
    #[arg(long, default_value = "127.0.0.1", requires = "web")]
    address: IpAddr,
    /// Token that opens the page; default: none on 127.0.0.1, a random one on other addresses.
    #[arg(long, default_value = "", hide_default_value = true, requires = "web")]
    token: String,
}

/// The page while it is served.
pub(crate) struct Web {
    page: Threaded,
    teller: Teller,
}

impl Web {
    /// Serves a page of what happens on `bus`, if it is wanted, and prints its address. `robot` is the robot's namespace.
    pub(crate) fn start(bus: &Loopback, args: &WebArgs, robot: &str) -> Result<Option<Self>> {
        if !args.web {
            return Ok(None);
        }
        let server = Server::start(args.address, args.port, &args.token)?;
        say!("Live page: {}  (Ctrl-C ends)", server.url());
        let options = SceneOptions { robot: robot.to_owned(), ..SceneOptions::default() };
        let teller = server.teller();
        let page = Threaded::start(bus, "dashboard", move |mw| dashboard(mw, &server, options));
        Ok(Some(Self { page, teller }))
    }

    /// Says that the run has ended, and keeps the page up until the user has seen enough.
    pub(crate) fn stay(&self, bus: &Loopback, interrupt: &Interrupt) {
        self.teller.ended("ended");
        while !interrupt.is_set() && !self.page.is_finished() {
            bus.settle();
            thread::sleep(LOOK_AGAIN);
        }
    }

    /// Closes the page.
    pub(crate) fn end(self) -> Result<()> {
        self.page.end("the live page")
    }
}
