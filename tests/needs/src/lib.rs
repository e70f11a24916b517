//! Attributes of tests that need what is not part of the project: data beside it, a browser.
//!
//! Where that is missing when the tests are compiled, the test is ignored, says in the output of `cargo test`
//! what it needs, and has `skipped_` before its name, so that `--ignored --skip skipped_` runs the others.
//! Write the attribute above `#[test]`.

use std::env;
use std::path::{Path, PathBuf};

use proc_macro::{Ident, TokenStream, TokenTree};

/// Needs a file or folder of the shared data: `#[needs::shared("records")]`. They lie in the folder
/// `SHAKEBENCH_SHARED`, by default `shared` beside the project.
#[proc_macro_attribute]
pub fn shared(what: TokenStream, test: TokenStream) -> TokenStream {
    let name = what.to_string();
    let name = name.trim_matches('"');
    let is_there = folder().is_some_and(|folder| folder.join(name).exists());
    let mut test = unless(is_there, &format!("needs {name} of the shared data"), test);
    // Compiles the test anew when the variable changes.
    let watch = "const _: Option<&str> = option_env!(\"SHAKEBENCH_SHARED\");";
    test.extend(watch.parse::<TokenStream>());
    test
}

/// Needs Chromium, as `tests/browser` looks for it; with `SHAKEBENCH_REQUIRE_BROWSER` the test is never ignored.
#[proc_macro_attribute]
pub fn browser(_: TokenStream, test: TokenStream) -> TokenStream {
    let paths: Vec<PathBuf> = env::var_os("PATH")
        .iter()
        .flat_map(env::split_paths)
        .collect();
    let is_there = ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .any(|name| paths.iter().any(|folder| folder.join(name).is_file()));
    let asked = ["CHROMIUM", "SHAKEBENCH_REQUIRE_BROWSER"]
        .into_iter()
        .any(|name| env::var_os(name).is_some());
    let mut test = unless(is_there || asked, "needs Chromium", test);
    let watch = "const _: [Option<&str>; 2] = \
                 [option_env!(\"CHROMIUM\"), option_env!(\"SHAKEBENCH_REQUIRE_BROWSER\")];";
    test.extend(watch.parse::<TokenStream>());
    test
}

fn folder() -> Option<PathBuf> {
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR")?);
    if let Some(told) = env::var_os("SHAKEBENCH_SHARED") {
        return Some(package.join(told));
    }
    let is_root = |folder: &&Path| folder.join("Cargo.lock").is_file();
    let root = package.ancestors().find(is_root)?;
    Some(root.join("../shared"))
}

/// The test as it is, or ignored and renamed.
fn unless(is_there: bool, reason: &str, test: TokenStream) -> TokenStream {
    if is_there {
        return test;
    }
    let is_ignored = test.to_string().contains("#[ignore");
    let mut marked: TokenStream = match is_ignored {
        true => TokenStream::new(),
        false => format!("#[ignore = {reason:?}]")
            .parse()
            .unwrap_or_default(),
    };
    let mut is_name = false;
    marked.extend(test.into_iter().map(|token| match token {
        TokenTree::Ident(ident) => {
            let renamed = is_name.then(|| Ident::new(&format!("skipped_{ident}"), ident.span()));
            is_name = ident.to_string() == "fn";
            TokenTree::Ident(renamed.unwrap_or(ident))
        }
        other => other,
    }));
    marked
}
