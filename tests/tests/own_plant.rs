//! The page docs/own-plant.md: its files are those of examples/servo, and its commands do what it states.

use std::process::Command;

use escapement_tests::program::{Folder, built, root};

fn page() -> String {
    std::fs::read_to_string(root().join("docs/own-plant.md")).expect("the page is there")
}

/// The blocks of the page in the language `language`.
fn blocks<'a>(page: &'a str, language: &str) -> Vec<&'a str> {
    let begin = format!("```{language}\n");
    let blocks = page.split(begin.as_str()).skip(1);
    blocks
        .map(|rest| rest.split("```").next().unwrap_or_default())
        .collect()
}

/// The words of a command line, quoted ones as one.
fn split_words(line: &str) -> Vec<String> {
    let parts = line.split('"').enumerate();
    let mut words = vec![String::new()];
    for (number, part) in parts {
        if number % 2 == 1 {
            words.last_mut().expect("there is one").push_str(part);
            continue;
        }
        for (at, word) in part.split(' ').enumerate() {
            if at > 0 {
                words.push(String::new());
            }
            words.last_mut().expect("there is one").push_str(word);
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[test]
fn files_on_the_page_equal_those_of_the_example() {
    let (page, example) = (page(), root().join("examples/servo"));
    let file = |name: &str| std::fs::read_to_string(example.join(name)).expect("the example is there");
    assert_eq!(blocks(&page, "rust"), [file("src/main.rs")]);
    assert_eq!(blocks(&page, "toml")[1], file("servo.toml"));
    let manifest: toml::Table = blocks(&page, "toml")[0].parse().expect("the manifest is TOML");
    let own: toml::Table = file("Cargo.toml").parse().expect("the manifest is TOML");
    let names = |manifest: &toml::Table| -> Vec<String> {
        let dependencies = manifest["dependencies"].as_table().expect("a table");
        dependencies.keys().cloned().collect()
    };
    assert_eq!(names(&manifest), names(&own), "the page names what the example needs");
}

#[test]
fn commands_on_the_page_have_the_documented_result() {
    let (page, folder) = (page(), Folder::new("own-plant"));
    folder.write("servo.toml", blocks(&page, "toml")[1]);
    let commands = page
        .lines()
        .filter_map(|line| line.strip_prefix("    cargo run --release -- "));
    let mut outputs = Vec::new();
    for line in commands {
        let output = Command::new(built().join("servo"))
            .current_dir(folder.path())
            .args(split_words(line))
            .output()
            .expect("it can be started");
        let code = if line.contains("--set") { 3 } else { 0 };
        assert_eq!(output.status.code(), Some(code), "{line}: {output:?}");
        outputs.push(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    assert_eq!(outputs.len(), 8, "one of the commands is not found");
    let printed = blocks(&page, "text")[0];
    assert!(
        outputs[1].starts_with(printed),
        "the page shows what is printed:\n{}",
        outputs[1]
    );
    assert!(outputs[2].contains("too much at t = "), "{}", outputs[2]);
    assert!(outputs[5].contains("deg/s"), "{}", outputs[5]);
    let figure = |path: std::path::PathBuf| std::fs::read_to_string(path).expect("there is a picture");
    assert_eq!(
        figure(folder.path().join("sweep/figure.svg")),
        figure(root().join("docs/figures/servo.svg")),
        "the picture of the page is that of its command"
    );
    assert!(folder.path().join("page.html").is_file());
}
