//! Writes pictures of random graphs, to look at: `draw_graphs FOLDER`.

#[path = "../tests/graphs/mod.rs"]
mod graphs;

use std::{error::Error, path::PathBuf, time::Instant};

use roscausal_discovery::draw;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("give a folder")?);
    std::fs::create_dir_all(&folder)?;
    for (n, per_variable) in
        [(3, 2.0), (3, 3.0), (6, 2.0), (9, 3.0), (10, 1.5), (15, 2.0), (30, 1.5), (60, 1.5), (60, 8.0)]
    {
        let model = graphs::random_model(n, per_variable, 7);
        let begin = Instant::now();
        let svg = draw::dag(&model);
        println!("{n} variables, {} links: {:.1} ms", model.links.len(), 1e3 * begin.elapsed().as_secs_f64());
        #[cfg(feature = "png")]
        std::fs::write(folder.join(format!("dag_{n}_{per_variable}.png")), draw::rasterise(&svg, 1.0)?.png)?;
        std::fs::write(folder.join(format!("dag_{n}_{per_variable}.svg")), svg)?;
        std::fs::write(folder.join(format!("tsdag_{n}_{per_variable}.svg")), draw::tsdag(&model))?;
    }
    Ok(())
}
