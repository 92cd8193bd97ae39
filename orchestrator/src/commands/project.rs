//! Common parts of `new` and `import`: an empty folder, its files, and the next commands.

use std::path::Path;

/// A file of a project.
pub struct File {
    /// Its path, relative to the folder of the project.
    pub path: String,
    /// Its content.
    pub contents: Vec<u8>,
}

/// Rejects a folder that is not empty.
pub fn check_empty(folder: &Path) -> Result<(), String> {
    use std::io::ErrorKind::{NotADirectory, NotFound};
    match std::fs::read_dir(folder) {
        Ok(mut entries) => match entries.next() {
            None => Ok(()),
            Some(_) => Err(format!(
                "{}: the folder is not empty; name a new one, or empty this one",
                folder.display()
            )),
        },
        Err(error) if error.kind() == NotFound => Ok(()),
        Err(error) if error.kind() == NotADirectory => Err(format!(
            "{}: it is a file; name a folder that is new or empty",
            folder.display()
        )),
        Err(error) => Err(format!("{}: {error}", folder.display())),
    }
}

/// Writes the files, lists them, and prints the next commands.
pub fn write(folder: &Path, title: &str, files: &[File], next: &[&str]) -> Result<(), String> {
    for file in files {
        let path = folder.join(&file.path);
        let wrong = |error: std::io::Error| format!("{} cannot be written: {error}", path.display());
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(wrong)?;
        }
        std::fs::write(&path, &file.contents).map_err(wrong)?;
        println!("{}", path.display());
    }
    let count = match files.len() {
        1 => "1 file".to_owned(),
        many => format!("{many} files"),
    };
    println!("\n{title}: {count}. What to do next:\n");
    if folder != Path::new(".") {
        println!("    cd {}", quoted(folder));
    }
    for command in next {
        println!("    {command}");
    }
    Ok(())
}

/// A path, quoted for a shell.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+,:@%".contains(c);
    if text.chars().all(plain) && !text.starts_with('-') {
        text
    } else if text.starts_with('-') {
        format!("-- '{}'", text.replace('\'', "'\\''"))
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}
