//! Connections of terminals: `a.flange -> b.flange` connects their members, in whichever direction each
//! has its output.

use fmi_import::{Causality, Description, Flow, MatchingRule, Member, Terminal};
use units::hint;

use super::checked::Component;
use super::link::{Link, Origin, VariableName};
use super::passage::{Hop, Transformation, Way};

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

    fn causality(&self, member: &Member) -> Result<Causality, String> {
        let array = self.description.array(&member.variable);
        let position = self.description.position(&member.variable);
        let position = position.or(array.map(|elements| elements.start));
        position
            .map(|at| self.description.variables[at].causality)
            .ok_or_else(|| {
                format!(
                    "the member `{}` of the terminal `{}` is the variable `{}`, which the FMU does not have",
                    member.name,
                    self.shown(),
                    member.variable
                )
            })
    }
}

/// The links between the members of two terminals, or the link as it is where it connects variables.
///
/// # Errors
/// A terminal connected to a variable, or two that do not fit, with what differs.
pub(super) fn members(components: &[Component], link: &Link) -> Result<Vec<Link>, String> {
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
            return Err(format!(
                "`{name}` is a terminal and `{mate}` is not{}",
                hint(&mate.variable, known)
            ));
        }
    };
    if link.way != Way::default() {
        return Err("terminals are connected as they are; connect their variables".to_string());
    }
    let pairs = pairs(&one, &other)?;
    let links = pairs
        .into_iter()
        .map(|pair| joined(&one, &other, pair, link));
    links.collect()
}

/// The members that belong together.
fn pairs<'a>(one: &Side<'a>, other: &Side<'a>) -> Result<Vec<(&'a Member, &'a Member)>, String> {
    let (a, b) = (one.terminal, other.terminal);
    let (first, second) = (one.shown(), other.shown());
    if let (Some(this), Some(that)) = (&a.kind, &b.kind)
        && this != that
    {
        return Err(format!(
            "the terminal `{first}` is of the kind `{this}`, and `{second}` of the kind `{that}`"
        ));
    }
    if a.rule != b.rule {
        return Err(format!(
            "the terminals `{first}` and `{second}` have different matching rules"
        ));
    }
    if a.has_streams || b.has_streams {
        return Err(format!(
            "the terminals `{first}` and `{second}` have stream variables; connect the variables one by one"
        ));
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
                .map(|name| (&second, name))
                .or(lacks(a, b).map(|name| (&first, name)));
            if let Some((side, name)) = lacking {
                return Err(format!(
                    "the terminal `{side}` has no member `{name}`; plugs fit where both have the same members"
                ));
            }
            named.collect()
        }
        MatchingRule::Bus => named.collect(),
        MatchingRule::Sequence => {
            if a.members.len() != b.members.len() {
                return Err(format!(
                    "the terminal `{first}` has {} members and `{second}` has {}",
                    a.members.len(),
                    b.members.len()
                ));
            }
            a.members.iter().zip(&b.members).collect()
        }
        MatchingRule::Other(rule) => {
            return Err(format!(
                "the matching rule `{rule}` of the terminal `{first}` is not one of `plug`, `bus` and \
                 `sequence`; connect the variables one by one"
            ));
        }
    };
    if found.is_empty() {
        return Err(format!(
            "the terminals `{first}` and `{second}` have no member in common"
        ));
    }
    Ok(found)
}

/// The link of two members.
fn joined(
    one: &Side,
    other: &Side,
    (member, mate): (&Member, &Member),
    link: &Link,
) -> Result<Link, String> {
    use Causality::{Input, Output};
    let forward = match (one.causality(member)?, other.causality(mate)?) {
        (Input, Output) => false,
        (Output | Causality::Local, Input) => true,
        (Input, Causality::Local) => false,
        _ => {
            return Err(format!(
                "the member `{}` is not an output of one of the terminals `{}` and `{}` and an input of the other",
                member.name,
                one.shown(),
                other.shown()
            ));
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
