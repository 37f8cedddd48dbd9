//! Shaders as text: the files of `wgsl/`, which are part of the binary, and how they are joined.
//!
//! A file says at its head which others it needs: `// uses explicit/layout, shared/kernel_*`. Names
//! are paths in `wgsl/` without the extension. A `*` stands for the interpolation kernel.

use gridfall_core::sim::setup::Kernel;

/// Names and texts.
const FILES: &[(&str, &str)] = &include!(concat!(env!("OUT_DIR"), "/wgsl.rs"));

/// Names of all files.
pub fn files() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|&(name, _)| name)
}

/// The name under which shaders know an interpolation kernel; only two have shaders.
pub fn kernel_name(kernel: Kernel) -> &'static str {
    if kernel == Kernel::Quadratic { "quadratic" } else { "compact" }
}

/// A text and the files that it needs, directly or through others: each once, before those that
/// use it.
///
/// Errors: a file that does not exist, or files that use each other in a circle.
pub fn compose(text: &str, kernel: Kernel) -> Result<String, String> {
    let mut composition = Composition { files: FILES, kernel, open: Vec::new(), done: Vec::new(), parts: Vec::new() };
    composition.add_uses(text)?;
    composition.parts.push(text.to_string());
    Ok(composition.parts.join("\n"))
}

/// The text of a file.
pub fn file(name: &str) -> Result<&'static str, String> {
    find(FILES, name).ok_or_else(|| format!("there is no wgsl/{name}.wgsl"))
}

/// Whether a shader's opening comment says `unchecked: …`, and why its indices are in range.
pub fn is_unchecked(text: &str) -> bool {
    text.lines().take_while(|line| line.starts_with("//")).any(|line| line.starts_with("// unchecked: "))
}

fn find<'a>(files: &[(&str, &'a str)], name: &str) -> Option<&'a str> {
    files.iter().find(|(found, _)| *found == name).map(|&(_, text)| text)
}

/// Names in the `uses` lines of a text's opening comment.
fn uses(text: &str) -> impl Iterator<Item = &str> {
    let head = text.lines().take_while(|line| line.starts_with("//"));
    head.filter_map(|line| line.strip_prefix("// uses "))
        .flat_map(|names| names.split(','))
        .map(str::trim)
        .filter(|name| !name.is_empty())
}

struct Composition<'a> {
    files: &'a [(&'a str, &'a str)],
    kernel: Kernel,
    /// Files whose uses are being added, outermost first.
    open: Vec<String>,
    done: Vec<String>,
    parts: Vec<String>,
}

impl Composition<'_> {
    fn add_uses(&mut self, text: &str) -> Result<(), String> {
        uses(text).try_for_each(|name| self.add(&name.replace('*', kernel_name(self.kernel))))
    }

    fn add(&mut self, name: &str) -> Result<(), String> {
        if self.done.iter().any(|done| done == name) {
            return Ok(());
        }
        let circle = self.open.iter().any(|open| open == name);
        let user = self.open.last().cloned().unwrap_or_else(|| "the shader".into());
        self.open.push(name.to_string());
        if circle {
            return Err(format!("shaders use each other in a circle: {}", self.open.join(" → ")));
        }
        let text = find(self.files, name).ok_or_else(|| format!("{user} uses {name}; there is no wgsl/{name}.wgsl"))?;
        self.add_uses(text)?;
        self.open.pop();
        self.done.push(name.to_string());
        self.parts.push(text.to_string());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn composed(files: &[(&str, &str)], text: &str) -> Result<Vec<String>, String> {
        let (open, done, parts) = (Vec::new(), Vec::new(), Vec::new());
        let mut composition = Composition { files, kernel: Kernel::Quadratic, open, done, parts };
        composition.add_uses(text).map(|()| composition.done)
    }

    #[test]
    fn each_part_comes_once_before_its_users() {
        let files = [
            ("a", "// A.\n//\n// uses b, c\nfn a() {}"),
            ("b", "// B.\n// uses c,\n// uses k_*\n"),
            ("c", "// C.\n\n// uses nothing: this is not at the head"),
            ("k_quadratic", "// K."),
        ];
        assert_eq!(composed(&files, "// uses a, c\n").unwrap(), ["c", "k_quadratic", "b", "a"]);
    }

    #[test]
    fn missing_files_and_circles_are_named() {
        let files = [("a", "// uses b"), ("b", "// uses a"), ("c", "// uses d")];
        assert_eq!(composed(&files, "// uses c").unwrap_err(), "c uses d; there is no wgsl/d.wgsl");
        assert_eq!(composed(&files, "// uses a").unwrap_err(), "shaders use each other in a circle: a → b → a");
    }
}
