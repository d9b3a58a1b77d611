//! `cargo xtask site`: the whole simulator as one folder without a server: the page, its modules
//! inside it, and the device as WebAssembly instead of the WebSocket. A folder opened from a disk
//! may load neither modules nor WebAssembly, so both are in the page as text. `board.html` in the
//! same folder is the page of a real board, over WebSerial.

use crate::setup;
use crate::shell::{self, Error};
use crate::wasm;
use crate::workspace_build::built;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The instructor's page, which is of no use without devices to look at.
const CLASS_PAGE: &str = "class.js";
/// The page, and what takes the place of some of its modules.
const PAGE: &str = "host-sim/page/js";
const IN_PLACE: &str = "host-sim/page/simulator-wasm/page";
/// The folder of its texts, a module for each language.
const STRINGS: &str = "strings";
/// The page of a real board, and the modules that it shares with the other pages.
const BOARD: &str = "host-sim/page/board-wasm/page";
const BOARD_SHARES: [&str; 2] = ["guide_steps.js", "bytes.js"];
/// Profiles and ticks whose bits are compared: an insertion and withdrawal each.
const COMPARED: [(&str, &str); 2] = [("adult", "80000"), ("firm-skin", "80000")];

/// Builds the site into `target/site`; its page.
pub(crate) fn build() -> Result<PathBuf, Error> {
    let device = wasm::build_crate("simulator-wasm")?;
    let board = wasm::build_crate("board-wasm")?;
    let top = shell::top();
    let pages = top.join(PAGE);
    let site = shell::target().join("site");
    let mut modules = scripts(&pages)?;
    let texts = scripts(&pages.join(STRINGS))?;
    modules.extend(texts.into_iter().map(|(name, text)| (format!("{STRINGS}/{name}"), text)));
    modules.extend(scripts(&top.join(IN_PLACE))?);
    let shared = modules.clone().into_iter().filter(|(name, _)| BOARD_SHARES.contains(&name.as_str()));
    let mut of_board: BTreeMap<String, String> = shared.collect();
    of_board.extend(scripts(&top.join(BOARD))?);
    modules.insert(
        "files.js".into(),
        binaries(&[("picture.wasm", &pages.join("picture.wasm")), ("device.wasm", &device)])?,
    );
    of_board.insert("files.js".into(), binaries(&[("board.wasm", &board)])?);
    write_page(&site, &pages.join("index.html"), "main.js", &modules)?;
    write_page(&site, &top.join(BOARD).join("board.html"), "board.js", &of_board)?;
    for file in ["style.css", "practice.css", "patient.css", "guide.css", "icon.svg"] {
        write(&site, file, &read(&pages.join(file))?)?;
    }
    let program = built(&["--bin", "host-sim"], "host-sim")?;
    let mut demo = Command::new(program);
    shell::run(demo.args(["demo", "missing", "--quiet", "--no-browser", "--out"]).arg(site.join("demo")))?;
    write(&site, "board.css", &read(&top.join(BOARD).join("board.css"))?)?;
    Ok(site.join("index.html"))
}

/// A module that holds binary files as text.
fn binaries(files: &[(&str, &Path)]) -> Result<String, Error> {
    let mut module = String::from("export const files = {\n");
    for (name, path) in files {
        let _ = writeln!(module, "  \"{name}\": \"{}\",", base64(&read(path)?));
    }
    module.push_str("};\n");
    Ok(module)
}

/// Writes a page with its modules inside it; `first` is the one that it starts.
fn write_page(
    site: &Path,
    page: &Path,
    first: &str,
    modules: &BTreeMap<String, String>,
) -> Result<(), Error> {
    let line = format!(r#"<script type="module" src="{first}"></script>"#);
    let text = String::from_utf8_lossy(&read(page)?).into_owned();
    if !text.contains(&line) {
        return Err(Error::new(format!("{} does not start {first} by `{line}`", page.display())));
    }
    let name = page.file_name().unwrap_or_default().to_string_lossy();
    write(site, &name, text.replacen(&line, &starts(modules, first), 1).as_bytes())
}

/// Builds it and says where it is.
pub(crate) fn run() -> Result<(), Error> {
    let page = build()?;
    println!("{} opens in a browser as it is, or from any web server", page.display());
    println!("another patient: add ?profile=firm-skin to its address");
    println!(
        "{} is the page of a real board, in Chrome, Edge or Chromium",
        page.with_file_name("board.html").display()
    );
    Ok(())
}

/// Checks that the device in the browser gives the same bits as host-sim's.
pub(crate) fn check() -> Result<(), Error> {
    setup::node()?;
    let device = wasm::build_crate("simulator-wasm")?;
    let program = built(&["--example", "device_digest"], "examples/device_digest")?;
    for (profile, ticks) in COMPARED {
        let native = shell::output(Command::new(&program).args([profile, ticks]))?;
        let mut node = Command::new("node");
        let browser = shell::output(
            node.current_dir(shell::top())
                .arg("host-sim/page/simulator-wasm/digest.mjs")
                .arg(&device)
                .args([profile, ticks]),
        )?;
        eprintln!("{profile}: {} natively, {} as WebAssembly", native.trim(), browser.trim());
        if native.trim() != browser.trim() {
            return Err(Error::new(format!(
                "profile {profile}: the device in a browser sends other bytes within {ticks} ticks than host-sim's"
            )));
        }
    }
    Ok(())
}

/// The modules of a folder by their names, importing each other by name alone.
fn scripts(folder: &Path) -> Result<BTreeMap<String, String>, Error> {
    let cannot =
        |error: &dyn std::fmt::Display| Error::new(format!("{} cannot be read: {error}", folder.display()));
    let mut modules = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(|error| cannot(&error))?.flatten() {
        let path = entry.path();
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        if name.ends_with(".js") && name != CLASS_PAGE {
            let text = fs::read_to_string(&path).map_err(|error| cannot(&error))?;
            modules.insert(
                name.to_string(),
                text.replace("from \"./", "from \"").replace("import \"./", "import \""),
            );
        }
    }
    Ok(modules)
}

/// The modules as addresses that hold them, and the start of the first.
fn starts(modules: &BTreeMap<String, String>, first: &str) -> String {
    let entries: Vec<String> = modules
        .iter()
        .map(|(name, text)| format!("\"{name}\":\"data:text/javascript;base64,{}\"", base64(text.as_bytes())))
        .collect();
    format!(
        "<script type=\"importmap\">{{\"imports\":{{{}}}}}</script>\n  <script type=\"module\">import \"{first}\";</script>",
        entries.join(",\n")
    )
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let mut bits = [0; 3];
        bits[..three.len()].copy_from_slice(three);
        let number = u32::from(bits[0]) << 16 | u32::from(bits[1]) << 8 | u32::from(bits[2]);
        for place in 0..4 {
            let letter = LETTERS[(number >> (18 - 6 * place) & 63) as usize];
            text.push(if place <= three.len() { char::from(letter) } else { '=' });
        }
    }
    text
}

fn read(path: &Path) -> Result<Vec<u8>, Error> {
    fs::read(path).map_err(|error| Error::new(format!("{} cannot be read: {error}", path.display())))
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Error> {
    let cannot = |error: std::io::Error| {
        Error::new(format!("{name} cannot be written to {}: {error}", folder.display()))
    };
    fs::create_dir_all(folder).map_err(cannot)?;
    fs::write(folder.join(name), bytes).map_err(cannot)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_the_published_one() {
        for (text, coded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(text.as_bytes()), coded);
        }
    }
}
