//! Plants that somebody else wrote: a folder with `key.json` and a rig file for each.

use super::plants::{Kind, Plant};
use serde_json::Value;
use std::path::Path;

/// The list of the plants in their folder.
pub(super) const KEY: &str = "key.json";

/// Reads the plants of a folder. `key.json` holds `plants`, each with its `file`, its `kind`
/// (twins, singles, pairs, nulls or outside) and the `names` that are right, none where nothing is
/// to be named.
///
/// # Errors
/// One sentence: the file, the plant, and what is wrong with it.
pub(super) fn plants(folder: &Path) -> Result<Vec<Plant>, String> {
    let key = folder.join(KEY);
    let refuse = |why: &str| format!("{}: {why}", key.display());
    let text = std::fs::read_to_string(&key).map_err(|cause| refuse(&format!("cannot be read ({cause})")))?;
    let value: Value =
        serde_json::from_str(&text).map_err(|cause| refuse(&format!("it is not JSON ({cause})")))?;
    let all = value["plants"].as_array().ok_or_else(|| refuse("has no list `plants`"))?;
    let one = |(index, plant): (usize, &Value)| {
        read(folder, plant).map_err(|why| refuse(&format!("plant {index}: {why}")))
    };
    all.iter().enumerate().map(one).collect()
}

fn read(folder: &Path, plant: &Value) -> Result<Plant, String> {
    let file = plant["file"].as_str().ok_or("it has no `file`")?;
    let kind = plant["kind"].as_str().and_then(Kind::of);
    let kind = kind.ok_or("its `kind` is not one of twins, singles, pairs, nulls and outside")?;
    let names = plant["names"].as_array().ok_or("it has no list `names`")?;
    let names = names.iter().map(|name| Ok(name.as_str().ok_or("a name is no text")?.to_owned()));
    let toml = std::fs::read_to_string(folder.join(file)).map_err(|cause| format!("{file}: {cause}"))?;
    Ok(Plant { kind, names: names.collect::<Result<_, &str>>()?, toml })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scratch::Scratch;

    #[test]
    fn plants_are_read_as_their_key_says() {
        let folder = Scratch::new().expect("a folder");
        let write = |name: &str, text: &str| std::fs::write(folder.0.join(name), text).expect("written");
        write("a.toml", "format = 1\n");
        write(KEY, r#"{"plants": [{"file": "a.toml", "kind": "twins", "names": ["cogging"]}]}"#);
        let all = plants(&folder.0).expect("they are whole");
        assert_eq!((all[0].kind, &all[0].names[..]), (Kind::Twin, &["cogging".to_owned()][..]));
        assert_eq!(all[0].toml, "format = 1\n");
        for (text, why) in [
            (r#"{"plants": [{"file": "b.toml", "kind": "twins", "names": []}]}"#, "plant 0: b.toml"),
            (r#"{"plants": [{"file": "a.toml", "kind": "all", "names": []}]}"#, "plant 0: its `kind`"),
            (r#"{"plants": [{"file": "a.toml", "kind": "nulls"}]}"#, "no list `names`"),
            ("{", "is not JSON"),
        ] {
            write(KEY, text);
            let error = plants(&folder.0).expect_err("it is refused");
            assert!(error.contains(why), "{error}");
        }
    }
}
