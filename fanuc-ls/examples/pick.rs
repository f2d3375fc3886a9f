//! Writes an LS program to its standard output, as a controller would print it: `pick > PICK.LS`.

use fanuc_ls::{Builder, Configuration, Rules, Speed, Termination};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let mut pick = Builder::new("PICK");
    let home = pick.joints([0.0, 0.0, 0.0, 0.0, -90.0, 0.0]); // degrees
    let part = |z| [250.0, -150.0, z, 180.0, 0.0, 0.0]; // mm, degrees
    let above = pick.cartesian(part(250.0), Configuration::new("N U T, 0, 0, 0"));
    let at = pick.cartesian(part(100.0), Configuration::new("N U T, 0, 0, 0"));
    pick.joint(home.clone(), Speed::percent(5), Termination::Fine);
    pick.joint(above.clone(), Speed::percent(5), Termination::Continuous(50));
    pick.linear(at, Speed::mm_per_sec(50.0), Termination::Fine);
    pick.linear(above, Speed::mm_per_sec(50.0), Termination::Continuous(50));
    pick.joint(home, Speed::percent(5), Termination::Fine);
    print!("{}", pick.build(&Rules::default())?.to_text(&Rules::default())?);
    Ok(())
}
