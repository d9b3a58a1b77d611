//! A page in a tab: what a test does with it and what it reads from it.

use super::devtools::DevTools;
use super::{Chromium, Error, PATIENCE};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// A picture in 80 ms or more: drawn without a graphics card it takes a core at 60 a second, and a
/// test that reads what the page says needs no more of them.
const FEW_PICTURES: &str = "{ const ask = requestAnimationFrame;
    window.requestAnimationFrame = (draw) => setTimeout(() => ask(draw), 80); }";

/// A page in a tab of its own.
pub struct Page {
    devtools: DevTools,
    complaints: Vec<String>,
}

impl Page {
    /// Opens `url` in a view of `width` by `height` CSS pixels, in which few pictures are drawn; a
    /// phone has fingers.
    pub fn open(browser: &Chromium, url: &str, width: u32, height: u32, phone: bool) -> Result<Self, Error> {
        let mut page = Self::blank(browser, width, height, phone)?;
        page.before_load(FEW_PICTURES)?;
        page.go(url)
    }

    /// The same with as many pictures as the browser can draw.
    pub fn open_lively(
        browser: &Chromium,
        url: &str,
        width: u32,
        height: u32,
        phone: bool,
    ) -> Result<Self, Error> {
        Self::blank(browser, width, height, phone)?.go(url)
    }

    fn blank(browser: &Chromium, width: u32, height: u32, phone: bool) -> Result<Self, Error> {
        let mut devtools = browser.devtools()?;
        devtools.open_tab()?;
        for domain in ["Page", "Runtime", "Log", "Network"] {
            devtools.call(&format!("{domain}.enable"), json!({}))?;
        }
        let mut page = Self { devtools, complaints: Vec::new() };
        page.resize(width, height, phone)?;
        Ok(page)
    }

    fn go(mut self, url: &str) -> Result<Self, Error> {
        self.devtools.call("Page.navigate", json!({ "url": url }))?;
        Ok(self)
    }

    /// Runs a script before every load of the page from now on.
    pub fn before_load(&mut self, script: &str) -> Result<(), Error> {
        let script = json!({ "source": script });
        self.devtools.call("Page.addScriptToEvaluateOnNewDocument", script).map(drop)
    }

    /// Shows the page in a view of another size, in CSS pixels.
    pub fn resize(&mut self, width: u32, height: u32, phone: bool) -> Result<(), Error> {
        let view = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": phone });
        self.devtools.call("Emulation.setDeviceMetricsOverride", view)?;
        self.devtools.call("Emulation.setTouchEmulationEnabled", json!({ "enabled": phone })).map(drop)
    }

    /// Light or dark, as the person's system would ask for.
    pub fn dark(&mut self, dark: bool) -> Result<(), Error> {
        let value = if dark { "dark" } else { "light" };
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": value }] });
        self.devtools.call("Emulation.setEmulatedMedia", features).map(drop)
    }

    /// The languages that the person prefers, as `de-CH,de`; the next load of a page hears of them.
    pub fn languages(&mut self, tags: &str) -> Result<(), Error> {
        let agent = self.text("navigator.userAgent")?;
        let asked = json!({ "userAgent": agent, "acceptLanguage": tags });
        self.devtools.call("Emulation.setUserAgentOverride", asked).map(drop)
    }

    /// The value of a JavaScript expression; a promise is waited for.
    pub fn evaluate(&mut self, expression: &str) -> Result<Value, Error> {
        let ask = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let mut answer = self.devtools.call("Runtime.evaluate", ask)?;
        match answer.get("exceptionDetails") {
            Some(details) => Err(format!("{expression}: {details}")),
            None => Ok(answer["result"]["value"].take()),
        }
    }

    /// A number that an expression gives.
    pub fn number(&mut self, expression: &str) -> Result<f64, Error> {
        self.evaluate(expression)?.as_f64().ok_or_else(|| format!("{expression} is not a number"))
    }

    /// A text that an expression gives.
    pub fn text(&mut self, expression: &str) -> Result<String, Error> {
        let value = self.evaluate(expression)?;
        value.as_str().map(str::to_owned).ok_or_else(|| format!("{expression} is not a text"))
    }

    /// Waits until an expression is true; what was waited for where it does not become so.
    pub fn wait(&mut self, what: &str, expression: &str) -> Result<(), Error> {
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            // A page that is just being loaded has not everything yet.
            if self.evaluate(expression).is_ok_and(|value| value == json!(true)) {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let state = self.text("document.body.innerText").unwrap_or_default().replace('\n', " | ");
        Err(format!("{what}: not within {} s; the page shows: {state}", PATIENCE.as_secs()))
    }

    /// Middle of the element with `id` in CSS pixels.
    pub fn middle(&mut self, id: &str) -> Result<(f64, f64), Error> {
        let rectangle = format!("document.getElementById('{id}').getBoundingClientRect()");
        let x = self.number(&format!("{rectangle}.x + {rectangle}.width / 2"))?;
        let y = self.number(&format!("{rectangle}.y + {rectangle}.height / 2"))?;
        Ok((x, y))
    }

    /// A mouse event as the system would send it: `mousePressed`, `mouseMoved` or `mouseReleased`,
    /// left button.
    pub fn mouse(&mut self, kind: &str, (x, y): (f64, f64)) -> Result<(), Error> {
        let buttons = if kind == "mouseReleased" { 0 } else { 1 };
        let event =
            json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1 });
        self.devtools.call("Input.dispatchMouseEvent", event).map(drop)
    }

    /// A finger: `touchStart`, `touchMove` or `touchEnd`.
    pub fn touch(&mut self, kind: &str, (x, y): (f64, f64)) -> Result<(), Error> {
        let points = if kind == "touchEnd" { json!([]) } else { json!([{ "x": x, "y": y }]) };
        self.devtools
            .call("Input.dispatchTouchEvent", json!({ "type": kind, "touchPoints": points }))
            .map(drop)
    }

    /// Clicks the middle of the element with `id`.
    pub fn click(&mut self, id: &str) -> Result<(), Error> {
        let at = self.middle(id)?;
        self.mouse("mousePressed", at)?;
        self.mouse("mouseReleased", at)
    }

    /// Presses and lets go a key, e.g. `Escape`.
    pub fn press(&mut self, key: &str, code: &str, windows_code: u32) -> Result<(), Error> {
        for kind in ["rawKeyDown", "keyUp"] {
            let event =
                json!({ "type": kind, "key": key, "code": code, "windowsVirtualKeyCode": windows_code });
            self.devtools.call("Input.dispatchKeyEvent", event)?;
        }
        Ok(())
    }

    /// Writes a picture of the view to `file`, to be looked at.
    pub fn photograph(&mut self, file: &std::path::Path) -> Result<(), Error> {
        let picture = self.screenshot()?;
        std::fs::write(file, picture).map_err(|e| format!("cannot write {}: {e}", file.display()))
    }

    /// The view as a PNG.
    pub fn screenshot(&mut self) -> Result<Vec<u8>, Error> {
        let picture = self.devtools.call("Page.captureScreenshot", json!({ "format": "png" }))?;
        decode_base64(picture["data"].as_str().unwrap_or_default()).ok_or_else(|| "not a picture".into())
    }

    /// Bytes of all answers to this page's requests so far, headers not counted.
    pub fn transferred_bytes(&mut self) -> Result<f64, Error> {
        self.number(
            "performance.getEntriesByType('resource').concat(performance.getEntriesByType('navigation')) \
             .reduce((sum, entry) => sum + entry.encodedBodySize, 0)",
        )
    }

    /// Errors in the console and uncaught exceptions since the last time.
    pub fn complaints(&mut self) -> Result<Vec<String>, Error> {
        for event in self.devtools.events()? {
            let parameters = &event["params"];
            let complaint = match event["method"].as_str() {
                Some("Runtime.exceptionThrown") => Some(parameters["exceptionDetails"].to_string()),
                Some("Runtime.consoleAPICalled") if parameters["type"] == "error" => {
                    Some(parameters["args"].to_string())
                }
                Some("Log.entryAdded") if parameters["entry"]["level"] == "error" => {
                    Some(parameters["entry"]["text"].to_string())
                }
                _ => None,
            };
            self.complaints.extend(complaint);
        }
        Ok(std::mem::take(&mut self.complaints))
    }
}

/// Standard base64 with padding; `None` where it is not.
fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| match byte {
        b'A'..=b'Z' => Some(byte - b'A'),
        b'a'..=b'z' => Some(byte - b'a' + 26),
        b'0'..=b'9' => Some(byte - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    for four in text.trim_end_matches('=').as_bytes().chunks(4) {
        let mut bits = 0u32;
        for byte in four {
            bits = bits << 6 | u32::from(digit(*byte)?);
        }
        bits <<= 6 * (4 - four.len());
        let [_, whole @ ..] = bits.to_be_bytes();
        bytes.extend(whole.iter().take(four.len() - 1));
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::decode_base64;

    #[test]
    fn base64_of_every_length() {
        assert_eq!(decode_base64(""), Some(vec![]));
        assert_eq!(decode_base64("TQ=="), Some(b"M".to_vec()));
        assert_eq!(decode_base64("TWE="), Some(b"Ma".to_vec()));
        assert_eq!(decode_base64("TWFu"), Some(b"Man".to_vec()));
        assert_eq!(decode_base64("!!!!"), None);
    }
}
