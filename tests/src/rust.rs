//! Rust sources as text without comments and literals, their functions, and the paths that they name.

/// `text` with comments, strings and characters blanked out; every line keeps its length and its number.
pub fn code_of(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let mut code = String::with_capacity(text.len());
    let mut at = 0;
    while at < chars.len() {
        let end = end_of_blank(&chars, at);
        for &c in &chars[at..end.max(at + 1)] {
            code.push(if end == at || c == '\n' { c } else { ' ' });
        }
        at = end.max(at + 1);
    }
    code
}

/// The end of the comment, string or character that begins at `at`; `at` when none begins there.
fn end_of_blank(chars: &[char], at: usize) -> usize {
    let rest = &chars[at..];
    let within_word = at > 0 && (chars[at - 1].is_alphanumeric() || chars[at - 1] == '_');
    match rest {
        ['/', '/', ..] => at + rest.iter().position(|&c| c == '\n').unwrap_or(rest.len()),
        ['/', '*', ..] => end_of_block(chars, at),
        ['"', ..] => end_of_string(chars, at + 1),
        ['b', '"', ..] if !within_word => end_of_string(chars, at + 2),
        ['r', '"' | '#', ..] if !within_word => end_of_raw(chars, at, at + 1),
        ['b', 'r', '"' | '#', ..] if !within_word => end_of_raw(chars, at, at + 2),
        ['\'', '\\', ..] => {
            // The escaped character may be a quote itself.
            let close = rest[3..].iter().position(|&c| c == '\'');
            at + close.map_or(rest.len(), |close| 3 + close + 1)
        }
        ['\'', _, '\'', ..] => at + 3,
        _ => at,
    }
}

fn end_of_block(chars: &[char], from: usize) -> usize {
    let (mut depth, mut at) = (0, from);
    while at < chars.len() {
        match chars[at..] {
            ['/', '*', ..] => (depth, at) = (depth + 1, at + 2),
            ['*', '/', ..] => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            break;
        }
    }
    at
}

fn end_of_string(chars: &[char], mut at: usize) -> usize {
    while at < chars.len() && chars[at] != '"' {
        at += if chars[at] == '\\' { 2 } else { 1 };
    }
    (at + 1).min(chars.len())
}

/// Returns `begin` when an apparent raw string is a raw identifier.
fn end_of_raw(chars: &[char], begin: usize, at: usize) -> usize {
    let hashes = chars[at..].iter().take_while(|&&c| c == '#').count();
    if chars.get(at + hashes) != Some(&'"') {
        return begin;
    }
    let mut at = at + hashes + 1;
    while at < chars.len() {
        let closes = chars[at] == '"' && chars[at + 1..].iter().take(hashes).filter(|&&c| c == '#').count() == hashes;
        at += 1;
        if closes {
            return at + hashes;
        }
    }
    at
}

/// A word, or a sign, and the line on which it stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Token {
    /// A word, `::`, or one character.
    pub text: String,
    /// From 1 on.
    pub line: usize,
}

/// The tokens of code without comments and strings.
pub fn tokens(code: &str) -> Vec<Token> {
    let mut tokens = Vec::new();
    for (number, line) in code.lines().enumerate() {
        let mut rest = line;
        while let Some(first) = rest.chars().next() {
            let word = rest
                .find(|c: char| !c.is_alphanumeric() && c != '_')
                .unwrap_or(rest.len());
            let length = match word {
                0 if rest.starts_with("::") => 2,
                0 => first.len_utf8(),
                word => word,
            };
            if !first.is_whitespace() {
                tokens.push(Token {
                    text: rest[..length].to_owned(),
                    line: number + 1,
                });
            }
            rest = &rest[length..];
        }
    }
    tokens
}

/// A function with a body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Function {
    /// Its name.
    pub name: String,
    /// The line with `fn`.
    pub line: usize,
    /// Lines from there to the closing brace.
    pub lines: usize,
}

/// The functions of a source, including nested ones.
pub fn functions(code: &str) -> Vec<Function> {
    let tokens = tokens(code);
    let mut found = Vec::new();
    for (at, pair) in tokens.windows(2).enumerate() {
        let named = pair[1].text.starts_with(|c: char| c.is_alphabetic() || c == '_');
        if pair[0].text != "fn" || !named {
            continue;
        }
        // A body, or a semicolon after a signature: arrays in a signature are in brackets.
        let mut depth = 0;
        let body = tokens[at..].iter().position(|token| {
            match token.text.as_str() {
                "(" | "[" => depth += 1,
                ")" | "]" => depth -= 1,
                _ => {}
            }
            depth == 0 && matches!(token.text.as_str(), "{" | ";")
        });
        let Some(body) = body.map(|body| at + body).filter(|&body| tokens[body].text == "{") else {
            continue;
        };
        let end = closing(&tokens, body);
        found.push(Function {
            name: pair[1].text.clone(),
            line: pair[0].line,
            lines: tokens[end].line - pair[0].line + 1,
        });
    }
    found
}

/// The brace that closes the one at `open`; the last token if there is none.
pub fn closing(tokens: &[Token], open: usize) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate().skip(open) {
        match token.text.as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at;
        }
    }
    tokens.len() - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_strings_and_characters_are_no_code() {
        let text = "a // b\n/* c /* d */ */ e \"f \\\" g\" 'h' '\\'' b\"i\" r#\"j \" k\"# l<'m> r#n br\"o\"\n";
        let code = code_of(text);
        let words: Vec<String> = tokens(&code).into_iter().map(|token| token.text).collect();
        assert_eq!(words, ["a", "e", "l", "<", "'", "m", ">", "r", "#", "n"]);
        assert_eq!(code.lines().count(), 2);
    }

    #[test]
    fn functions_are_counted_from_signature_to_closing_brace() {
        let code =
            code_of("fn a(x: [u8; 2])\n-> u8 {\n    fn b() {}\n    '}'\n}\ntrait T { fn c(); }\ntype F = fn(u8);\n");
        let found: Vec<(String, usize)> = functions(&code).into_iter().map(|one| (one.name, one.lines)).collect();
        assert_eq!(found, [("a".to_owned(), 5), ("b".to_owned(), 1)]);
    }
}
