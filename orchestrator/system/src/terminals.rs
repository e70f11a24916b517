//! Connections of terminals: `a.flange -> b.flange` connects their members, in whichever direction each
//! has its output.

use fmi_import::{Causality, Description, Flow, MatchingRule, Member, Terminal};
use units::hint;

use super::checked::Component;
use super::link::{Link, Origin, VariableName};
use super::passage::{Hop, Transformation, Way};

/// Why two terminals are not connected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TerminalError {
    /// A member without a variable.
    #[error(
        "the member `{member}` of the terminal `{terminal}` is the variable `{variable}`, which the FMU does \
         not have"
    )]
    NoVariable {
        /// The member.
        member: String,
        /// The terminal, with its component.
        terminal: String,
        /// The variable.
        variable: String,
    },
    /// A terminal and something else.
    #[error("`{terminal}` is a terminal and `{mate}` is not{hint}")]
    NotATerminal {
        /// The terminal, with its component.
        terminal: String,
        /// The other end.
        mate: VariableName,
        /// The nearest terminal.
        hint: String,
    },
    /// A transformation on the way between terminals.
    #[error("terminals are connected as they are; connect their variables")]
    Transformed,
    /// Terminals of two kinds.
    #[error("the terminal `{first}` is of the kind `{kind}`, and `{second}` of the kind `{other}`")]
    Kinds {
        /// The one.
        first: String,
        /// Its kind.
        kind: String,
        /// The other.
        second: String,
        /// Its kind.
        other: String,
    },
    /// Terminals that differ, or have something that cannot be connected.
    #[error("the terminals `{first}` and `{second}` have {what}")]
    Differ {
        /// The one.
        first: String,
        /// The other.
        second: String,
        /// What does not fit.
        what: &'static str,
    },
    /// A plug that lacks a member.
    #[error(
        "the terminal `{terminal}` has no member `{member}`; connect terminals that have the same members"
    )]
    NoMember {
        /// The terminal that lacks it.
        terminal: String,
        /// The member of the other one.
        member: String,
    },
    /// Sequences of two lengths.
    #[error("the terminal `{first}` has {members} members and `{second}` has {others}")]
    Counts {
        /// The one.
        first: String,
        /// How many it has.
        members: usize,
        /// The other.
        second: String,
        /// How many that has.
        others: usize,
    },
    /// A rule of somebody else.
    #[error(
        "the matching rule `{rule}` of the terminal `{terminal}` is not one of `plug`, `bus` and `sequence`; \
         connect the variables one by one"
    )]
    Rule {
        /// The rule.
        rule: String,
        /// The terminal.
        terminal: String,
    },
    /// Two inputs, two outputs, or something else.
    #[error(
        "the member `{member}` is not an output of one of the terminals `{first}` and `{second}` and an input \
         of the other"
    )]
    Direction {
        /// The member.
        member: String,
        /// The one.
        first: String,
        /// The other.
        second: String,
    },
}

/// One side: the component's name, its description, and the terminal.
struct Side<'a> {
    component: &'a str,
    description: &'a Description,
    terminal: &'a Terminal,
}

impl<'a> Side<'a> {
    /// The terminal of a name, if it is one and not a variable.
    fn of(components: &'a [Component], name: &VariableName) -> Option<Self> {
        let part = components.iter().find(|part| part.name == name.component)?;
        let description = &part.fmu.description;
        let is_variable = description.position(&name.variable).is_some()
            || description.array(&name.variable).is_some();
        let terminal = description.terminal(&name.variable)?;
        (!is_variable).then_some(Self {
            component: &part.name,
            description,
            terminal,
        })
    }

    fn shown(&self) -> String {
        format!("{}.{}", self.component, self.terminal.name)
    }

    fn causality(&self, member: &Member) -> Result<Causality, TerminalError> {
        let array = self.description.array(&member.variable);
        let position = self.description.position(&member.variable);
        let position = position.or(array.map(|elements| elements.start));
        position
            .map(|at| self.description.variables[at].causality)
            .ok_or_else(|| TerminalError::NoVariable {
                member: member.name.clone(),
                terminal: self.shown(),
                variable: member.variable.clone(),
            })
    }
}

/// The links between the members of two terminals, or the link as it is where it connects variables.
///
/// # Errors
/// A terminal connected to a variable, or two that do not fit, with what differs.
pub(super) fn members(components: &[Component], link: &Link) -> Result<Vec<Link>, TerminalError> {
    let Origin::Output(from) = &link.from else {
        return Ok(vec![link.clone()]);
    };
    let (one, other) = match (Side::of(components, from), Side::of(components, &link.to)) {
        (None, None) => return Ok(vec![link.clone()]),
        (Some(one), Some(other)) => (one, other),
        (one, other) => {
            let (name, mate) = match one.or(other) {
                Some(side) if side.shown() == from.to_string() => (side.shown(), &link.to),
                Some(side) => (side.shown(), from),
                None => return Ok(vec![link.clone()]),
            };
            let part = components.iter().find(|part| part.name == mate.component);
            let known = part.map(|part| part.fmu.description.terminals.iter());
            let known = known.into_iter().flatten();
            let known = known.map(|terminal| terminal.name.as_str());
            return Err(TerminalError::NotATerminal {
                terminal: name,
                mate: mate.clone(),
                hint: hint(&mate.variable, known),
            });
        }
    };
    if link.way != Way::default() {
        return Err(TerminalError::Transformed);
    }
    let pairs = pairs(&one, &other)?;
    let links = pairs
        .into_iter()
        .map(|pair| joined(&one, &other, pair, link));
    links.collect()
}

/// The members that belong together.
fn pairs<'a>(
    one: &Side<'a>,
    other: &Side<'a>,
) -> Result<Vec<(&'a Member, &'a Member)>, TerminalError> {
    let (a, b) = (one.terminal, other.terminal);
    let (first, second) = (one.shown(), other.shown());
    if let (Some(this), Some(that)) = (&a.kind, &b.kind)
        && this != that
    {
        return Err(TerminalError::Kinds {
            first,
            kind: this.clone(),
            second,
            other: that.clone(),
        });
    }
    let differ = |what| {
        let (first, second) = (one.shown(), other.shown());
        Err(TerminalError::Differ {
            first,
            second,
            what,
        })
    };
    if a.rule != b.rule {
        return differ("different matching rules");
    }
    if a.has_streams || b.has_streams {
        return differ("stream variables; connect the variables one by one");
    }
    let mate = |member: &Member| b.members.iter().find(|mate| mate.name == member.name);
    let named = a
        .members
        .iter()
        .filter_map(|member| Some((member, mate(member)?)));
    let found: Vec<(&Member, &Member)> = match &a.rule {
        MatchingRule::Plug => {
            let lacks = |of: &Terminal, has: &Terminal| {
                let missing = has
                    .members
                    .iter()
                    .find(|member| of.members.iter().all(|mate| mate.name != member.name));
                missing.map(|member| member.name.clone())
            };
            let lacking = lacks(b, a)
                .map(|name| (second, name))
                .or(lacks(a, b).map(|name| (first, name)));
            if let Some((terminal, member)) = lacking {
                return Err(TerminalError::NoMember { terminal, member });
            }
            named.collect()
        }
        MatchingRule::Bus => named.collect(),
        MatchingRule::Sequence => {
            if a.members.len() != b.members.len() {
                return Err(TerminalError::Counts {
                    first,
                    members: a.members.len(),
                    second,
                    others: b.members.len(),
                });
            }
            a.members.iter().zip(&b.members).collect()
        }
        MatchingRule::Other(rule) => {
            return Err(TerminalError::Rule {
                rule: rule.clone(),
                terminal: first,
            });
        }
    };
    if found.is_empty() {
        return differ("no member in common");
    }
    Ok(found)
}

/// The link of two members.
fn joined(
    one: &Side,
    other: &Side,
    (member, mate): (&Member, &Member),
    link: &Link,
) -> Result<Link, TerminalError> {
    use Causality::{Input, Output};
    let forward = match (one.causality(member)?, other.causality(mate)?) {
        (Input, Output) => false,
        (Output | Causality::Local, Input) => true,
        (Input, Causality::Local) => false,
        _ => {
            return Err(TerminalError::Direction {
                member: member.name.clone(),
                first: one.shown(),
                second: other.shown(),
            });
        }
    };
    let (from, to) = match forward {
        true => ((one, member), (other, mate)),
        false => ((other, mate), (one, member)),
    };
    // What flows out of one flows into the other.
    let is_turned = from.1.flow == to.1.flow && from.1.flow != Flow::Signal;
    let hop = Hop {
        end: None,
        suppresses_units: false,
        transformation: Transformation::Linear {
            factor: -1.0,
            offset: 0.0,
        },
    };
    Ok(Link {
        from: Origin::output(from.0.component, &from.1.variable),
        to: VariableName::new(to.0.component, &to.1.variable),
        way: Way {
            start: None,
            hops: if is_turned { vec![hop] } else { Vec::new() },
        },
        line: link.line,
    })
}
