//! Plays a frame once and writes its picture: `hankel-example-player FOLDER PICTURE.png`.

use std::path::PathBuf;
use std::process::ExitCode;

use hankel_example_player::Player;

fn main() -> ExitCode {
    let args: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [folder, out] = args.as_slice() else {
        eprintln!("usage: hankel-example-player FOLDER PICTURE.png");
        return ExitCode::from(2);
    };
    let played = Player::open(folder).and_then(|mut player| {
        player.run()?;
        player.picture()?.save(out)
    });
    match played {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}
