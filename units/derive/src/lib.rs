//! The derive of `units::Parameters`: a struct's fields become rows of a table of parameters.

use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};
use syn::parse::{Parse, ParseStream};
use syn::{Attribute, Data, DeriveInput, Error, Expr, Field, Lit, LitInt, LitStr, Meta, Token};

/// Implements `units::Parameters`, as described there.
#[proc_macro_derive(Parameters, attributes(parameter, parameters))]
pub fn parameters(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let expanded = syn::parse(input).and_then(|input| expand(&input));
    expanded
        .unwrap_or_else(|error| error.to_compile_error())
        .into()
}

fn expand(input: &DeriveInput) -> syn::Result<TokenStream> {
    let Data::Struct(data) = &input.data else {
        return Err(Error::new_spanned(&input.ident, "expected a struct"));
    };
    let mut prefix = String::new();
    for attribute in named(&input.attrs, "parameters") {
        attribute.parse_nested_meta(|meta| {
            if !meta.path.is_ident("prefix") {
                return Err(meta.error("expected `prefix = \"...\"`"));
            }
            prefix = meta.value()?.parse::<LitStr>()?.value();
            Ok(())
        })?;
    }
    let (mut names, mut visits, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for field in &data.fields {
        let Some(ident) = &field.ident else {
            return Err(Error::new_spanned(field, "expected named fields"));
        };
        if named(&field.attrs, "parameters").next().is_some() {
            visits.push(quote!(::units::Parameters::visit(&mut self.#ident, visit);));
        }
        let mut elements = Vec::new();
        for attribute in named(&field.attrs, "parameter") {
            let row = match &attribute.meta {
                Meta::Path(_) => Row::default(),
                _ => attribute.parse_args()?,
            };
            names.extend(row.constant(ident, &prefix));
            let place = match &row.index {
                None => quote!(&mut self.#ident),
                Some(index) => {
                    if index.base10_parse::<usize>()? != elements.len() {
                        return Err(Error::new_spanned(index, "expected the next index from 0"));
                    }
                    let element = format_ident!("element_{}", elements.len());
                    elements.push(element.clone());
                    quote!(#element)
                }
            };
            rows.push(row.visit(field, ident, &prefix, &place)?);
        }
        if !elements.is_empty() {
            // All at once, for the elements of an array are not borrowed one by one.
            visits.push(quote!(let [#(#elements,)* ..] = &mut self.#ident;));
        }
        visits.append(&mut rows);
    }
    let (own, (generics, types, clause)) = (&input.ident, input.generics.split_for_impl());
    Ok(quote! {
        impl #generics #own #types #clause { #(#names)* }

        impl #generics ::units::Parameters for #own #types #clause {
            fn visit<'visited>(
                &'visited mut self,
                visit: &mut dyn FnMut(&'static ::units::Parameter, ::units::Slot<'visited>),
            ) {
                #(#visits)*
            }
        }
    })
}

fn named<'a>(attributes: &'a [Attribute], name: &str) -> impl Iterator<Item = &'a Attribute> {
    attributes.iter().filter(move |a| a.path().is_ident(name))
}

/// What `#[parameter(...)]` says.
#[derive(Default)]
struct Row {
    index: Option<LitInt>,
    unit: Option<LitStr>,
    shown: Option<LitStr>,
    range: Option<Ident>,
    name: Option<Expr>,
    about: Option<Expr>,
    min: Option<Expr>,
    max: Option<Expr>,
}

impl Parse for Row {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        let mut row = Self::default();
        while !input.is_empty() {
            if input.peek(LitStr) {
                row.unit = Some(input.parse()?);
                if input.parse::<Option<Token![=>]>>()?.is_some() {
                    row.shown = Some(input.parse()?);
                }
            } else if input.peek(LitInt) {
                row.index = Some(input.parse()?);
            } else {
                row.parse_word(input)?;
            }
            input.parse::<Option<Token![,]>>()?;
        }
        Ok(row)
    }
}

impl Row {
    fn parse_word(&mut self, input: ParseStream<'_>) -> syn::Result<()> {
        let word: Ident = input.parse()?;
        let given = input.parse::<Option<Token![=]>>()?.is_some();
        let place = match (word.to_string().as_str(), given) {
            ("name", true) => &mut self.name,
            ("about", true) => &mut self.about,
            ("min", true) => &mut self.min,
            ("max", true) => &mut self.max,
            ("finite", false) => return self.limit(&word, "Finite"),
            ("positive", false) => return self.limit(&word, "Positive"),
            ("non_negative", false) => return self.limit(&word, "NonNegative"),
            _ => {
                let expected = "expected a unit, an index, `name =`, `about =`, `min =`, `max =`, \
                                `finite`, `positive` or `non_negative`";
                return Err(Error::new_spanned(word, expected));
            }
        };
        *place = Some(input.parse()?);
        Ok(())
    }

    fn limit(&mut self, word: &Ident, range: &str) -> syn::Result<()> {
        self.range = Some(Ident::new(range, word.span()));
        Ok(())
    }

    /// The name, unless it is an expression.
    fn literal(&self, field: &Ident, prefix: &str) -> Option<String> {
        match &self.name {
            None => Some(format!("{prefix}{field}")),
            Some(Expr::Lit(lit)) => match &lit.lit {
                Lit::Str(name) => Some(format!("{prefix}{}", name.value())),
                _ => None,
            },
            Some(_) => None,
        }
    }

    /// The constant that holds the name, unless somebody else's does.
    fn constant(&self, field: &Ident, prefix: &str) -> Option<TokenStream> {
        let name = self.literal(field, prefix)?;
        let plain = name.replace(|c: char| !c.is_ascii_alphanumeric(), "_");
        let constant = format_ident!("{}", plain.trim_end_matches('_').to_uppercase());
        let doc = format!("Name of the parameter `{name}`.");
        Some(quote!(#[doc = #doc] pub const #constant: &'static str = #name;))
    }

    fn visit(
        &self,
        field: &Field,
        ident: &Ident,
        prefix: &str,
        place: &TokenStream,
    ) -> syn::Result<TokenStream> {
        let name = match (self.literal(ident, prefix), &self.name) {
            (Some(name), _) => quote!(#name),
            (None, name) => quote!(#name),
        };
        let about = match &self.about {
            Some(about) => quote!(#about),
            None => {
                let about = summary(field, self.unit.as_ref())?;
                quote!(#about)
            }
        };
        let [unit, shown] = [&self.unit, &self.shown].map(option);
        let [min, max] = [&self.min, &self.max].map(option);
        let any = format_ident!("Any");
        let range = self.range.as_ref().unwrap_or(&any);
        Ok(quote! {
            visit(
                const {
                    &::units::Parameter {
                        name: #name,
                        about: #about,
                        unit: #unit,
                        shown: #shown,
                        min: #min,
                        max: #max,
                        range: ::units::Range::#range,
                    }
                },
                ::units::Slot::from(#place),
            );
        })
    }
}

fn option<T: quote::ToTokens>(value: &Option<T>) -> TokenStream {
    match value {
        Some(value) => quote!(Some(#value)),
        None => quote!(None),
    }
}

/// The first paragraph of the field's documentation, without the unit and the full stop at its end.
fn summary(field: &Field, unit: Option<&LitStr>) -> syn::Result<String> {
    let mut text = String::new();
    for attribute in named(&field.attrs, "doc") {
        let Meta::NameValue(meta) = &attribute.meta else {
            continue;
        };
        let Expr::Lit(lit) = &meta.value else {
            continue;
        };
        let Lit::Str(line) = &lit.lit else { continue };
        match line.value().trim() {
            "" if !text.is_empty() => break,
            line if text.is_empty() => text = line.to_string(),
            line => text = format!("{text} {line}"),
        }
    }
    let mut told = text.strip_suffix('.').unwrap_or(&text);
    if let Some(unit) = unit.map(LitStr::value) {
        let suffix = format!(", {unit}");
        told = told.strip_suffix(suffix.as_str()).unwrap_or(told);
    }
    if told.is_empty() {
        return Err(Error::new_spanned(
            field,
            "a parameter needs a description: a doc comment or `about = \"...\"`",
        ));
    }
    Ok(told.to_string())
}
