//! Words as a shell takes them, so that a command that is shown can be pasted.

/// The word as it is where a shell leaves it alone, else between single quotes.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_=:./,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[cfg(unix)]
    #[test]
    fn a_shell_gives_back_the_word_that_was_quoted() {
        for word in
            ["position=theta:deg", "position=theta (deg)", "it's $HOME", "a\"b`c`", "-tau [N·m]", "", "*"]
        {
            let out = Command::new("sh").args(["-c", &format!("printf %s {}", quoted(word))]).output();
            assert_eq!(String::from_utf8_lossy(&out.expect("a shell runs").stdout), word);
        }
    }
}
