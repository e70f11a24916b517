//! The shape of a `modelDescription.xml`: where elements and attributes are allowed, and the types
//! of attributes, as in the schemas of FMI 2.0 and 3.0.

use std::collections::HashMap;

use roxmltree::{Document, Node};

use super::Findings;

/// An element on a line: its name (after its parent's, where that matters), its attributes and,
/// behind `|`, its children; `!` what must be there, `*` anything.
const FMI2: &str = "
fmiModelDescription fmiVersion! modelName! guid! description author version copyright license generationTool generationDateAndTime variableNamingConvention numberOfEventIndicators | ModelExchange CoSimulation UnitDefinitions TypeDefinitions LogCategories DefaultExperiment VendorAnnotations ModelVariables! ModelStructure!
ModelExchange modelIdentifier! needsExecutionTool completedIntegratorStepNotNeeded canBeInstantiatedOnlyOncePerProcess canNotUseMemoryManagementFunctions canGetAndSetFMUstate canSerializeFMUstate providesDirectionalDerivative | SourceFiles
CoSimulation modelIdentifier! needsExecutionTool canHandleVariableCommunicationStepSize canInterpolateInputs maxOutputDerivativeOrder canRunAsynchronuously canBeInstantiatedOnlyOncePerProcess canNotUseMemoryManagementFunctions canGetAndSetFMUstate canSerializeFMUstate providesDirectionalDerivative | SourceFiles
SourceFiles | File!
File name!
UnitDefinitions | Unit!
Unit name! | BaseUnit DisplayUnit
BaseUnit kg m s A K mol cd rad factor offset
DisplayUnit name! factor offset
TypeDefinitions | SimpleType!
SimpleType name! description | Real Integer Boolean String Enumeration
SimpleType/Real quantity unit displayUnit relativeQuantity min max nominal unbounded
SimpleType/Integer quantity min max
SimpleType/Boolean
SimpleType/String
SimpleType/Enumeration quantity | Item!
Item name! value! description
LogCategories | Category!
Category name! description
DefaultExperiment startTime stopTime tolerance stepSize
VendorAnnotations | Tool!
Annotations | Tool!
Tool name! | *
ModelVariables | ScalarVariable!
ScalarVariable name! valueReference! description causality variability initial canHandleMultipleSetPerTimeInstant | Real Integer Boolean String Enumeration Annotations
ScalarVariable/Real declaredType quantity unit displayUnit relativeQuantity min max nominal unbounded start derivative reinit
ScalarVariable/Integer declaredType quantity min max start
ScalarVariable/Boolean declaredType start
ScalarVariable/String declaredType start
ScalarVariable/Enumeration declaredType! quantity min max start
ModelStructure | Outputs Derivatives InitialUnknowns
Outputs | Unknown!
Derivatives | Unknown!
InitialUnknowns | Unknown!
Unknown index! dependencies dependenciesKind
";

const FMI3: &str = "
fmiModelDescription fmiVersion! modelName! instantiationToken! description author version copyright license generationTool generationDateAndTime variableNamingConvention | ModelExchange CoSimulation ScheduledExecution UnitDefinitions TypeDefinitions LogCategories DefaultExperiment ModelVariables! ModelStructure! Annotations
ModelExchange modelIdentifier! needsExecutionTool canBeInstantiatedOnlyOncePerProcess canGetAndSetFMUState canSerializeFMUState providesDirectionalDerivatives providesAdjointDerivatives providesPerElementDependencies needsCompletedIntegratorStep providesEvaluateDiscreteStates | Annotations
CoSimulation modelIdentifier! needsExecutionTool canBeInstantiatedOnlyOncePerProcess canGetAndSetFMUState canSerializeFMUState providesDirectionalDerivatives providesAdjointDerivatives providesPerElementDependencies canHandleVariableCommunicationStepSize fixedInternalStepSize maxOutputDerivativeOrder recommendedIntermediateInputSmoothness providesIntermediateUpdate mightReturnEarlyFromDoStep canReturnEarlyAfterIntermediateUpdate hasEventMode providesEvaluateDiscreteStates | Annotations
ScheduledExecution modelIdentifier! needsExecutionTool canBeInstantiatedOnlyOncePerProcess canGetAndSetFMUState canSerializeFMUState providesDirectionalDerivatives providesAdjointDerivatives providesPerElementDependencies | Annotations
UnitDefinitions | Unit!
Unit name! | BaseUnit DisplayUnit Annotations
BaseUnit kg m s A K mol cd rad factor offset
DisplayUnit name! factor offset inverse | Annotations
TypeDefinitions | *
Item name! value! description | Annotations
LogCategories | Category!
Category name! description | Annotations
DefaultExperiment startTime stopTime tolerance stepSize | Annotations
Annotations | Annotation
Annotation type! | *
ModelVariables | Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary Enumeration Clock
Float32 VARIABLE initial start quantity unit displayUnit relativeQuantity unbounded min max nominal derivative reinit | Dimension Alias Annotations
Float64 VARIABLE initial start quantity unit displayUnit relativeQuantity unbounded min max nominal derivative reinit | Dimension Alias Annotations
Int8 VARIABLE initial start quantity min max | Dimension Alias Annotations
UInt8 VARIABLE initial start quantity min max | Dimension Alias Annotations
Int16 VARIABLE initial start quantity min max | Dimension Alias Annotations
UInt16 VARIABLE initial start quantity min max | Dimension Alias Annotations
Int32 VARIABLE initial start quantity min max | Dimension Alias Annotations
UInt32 VARIABLE initial start quantity min max | Dimension Alias Annotations
Int64 VARIABLE initial start quantity min max | Dimension Alias Annotations
UInt64 VARIABLE initial start quantity min max | Dimension Alias Annotations
Boolean VARIABLE initial start | Dimension Alias Annotations
String VARIABLE initial | Dimension Alias Annotations Start
Binary VARIABLE initial mimeType maxSize | Dimension Alias Annotations Start
Enumeration VARIABLE initial start quantity min max | Dimension Alias Annotations
Clock VARIABLE canBeDeactivated priority intervalVariability intervalDecimal shiftDecimal supportsFraction resolution intervalCounter shiftCounter | Dimension Alias Annotations
Dimension start valueReference
Alias name! description displayUnit
Start value!
ModelStructure | Output ContinuousStateDerivative ClockedState InitialUnknown EventIndicator
Output valueReference! dependencies dependenciesKind | Annotations
ContinuousStateDerivative valueReference! dependencies dependenciesKind | Annotations
ClockedState valueReference! dependencies dependenciesKind | Annotations
InitialUnknown valueReference! dependencies dependenciesKind | Annotations
EventIndicator valueReference! dependencies dependenciesKind | Annotations
";

/// What every variable of FMI 3.0 may have.
const VARIABLE: &str = "name! valueReference! description causality variability canHandleMultipleSetPerTimeInstant intermediateUpdate previous clocks declaredType";

/// Attributes that are true or false.
const TRUTHS: &[&str] = &[
    "needsExecutionTool",
    "completedIntegratorStepNotNeeded",
    "canBeInstantiatedOnlyOncePerProcess",
    "canNotUseMemoryManagementFunctions",
    "canGetAndSetFMUstate",
    "canGetAndSetFMUState",
    "canSerializeFMUstate",
    "canSerializeFMUState",
    "providesDirectionalDerivative",
    "providesDirectionalDerivatives",
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "canRunAsynchronuously",
    "relativeQuantity",
    "unbounded",
    "reinit",
    "canHandleMultipleSetPerTimeInstant",
    "intermediateUpdate",
    "hasEventMode",
    "providesIntermediateUpdate",
    "mightReturnEarlyFromDoStep",
    "canReturnEarlyAfterIntermediateUpdate",
    "needsCompletedIntegratorStep",
    "providesEvaluateDiscreteStates",
    "canBeDeactivated",
    "supportsFraction",
];
/// Attributes that are real numbers.
const REALS: &[&str] = &[
    "factor",
    "offset",
    "nominal",
    "startTime",
    "stopTime",
    "tolerance",
    "stepSize",
    "fixedInternalStepSize",
    "intervalDecimal",
    "shiftDecimal",
];
/// Attributes that are whole numbers.
const WHOLE: &[&str] = &[
    "valueReference",
    "kg",
    "m",
    "s",
    "A",
    "K",
    "mol",
    "cd",
    "rad",
    "numberOfEventIndicators",
    "maxOutputDerivativeOrder",
    "index",
    "value",
    "priority",
];

struct Shape {
    attributes: Vec<(&'static str, bool)>,
    /// None: anything.
    children: Option<Vec<(&'static str, bool)>>,
}

type Shapes = HashMap<&'static str, Shape>;

fn shapes(text: &'static str) -> Shapes {
    let marked = |word: &'static str| match word.strip_suffix('!') {
        Some(word) => (word, true),
        None => (word, false),
    };
    let lines = text.lines().filter(|line| !line.trim().is_empty());
    let shape = |line: &'static str| {
        let (front, children) = line.split_once('|').unwrap_or((line, ""));
        let mut words = front.split_whitespace();
        let name = words.next().unwrap_or_default();
        let attributes = words.flat_map(|word| match word {
            "VARIABLE" => VARIABLE.split_whitespace().map(marked).collect(),
            word => vec![marked(word)],
        });
        let children = children.trim();
        let children = (children != "*").then(|| children.split_whitespace().map(marked).collect());
        (
            name,
            Shape {
                attributes: attributes.collect(),
                children,
            },
        )
    };
    lines.map(shape).collect()
}

/// Checks the shape of the description.
pub(super) fn check(findings: &mut Findings, text: &str) {
    let Ok(document) = Document::parse(text) else {
        // Whoever reads the description says it.
        return;
    };
    let root = document.root_element();
    let shapes = match root.attribute("fmiVersion") {
        Some("2.0") => shapes(FMI2),
        Some(version) if version.starts_with("3.") => shapes(FMI3),
        _ => return,
    };
    if root.tag_name().namespace().is_some() {
        findings.error(
            &findings.place(root),
            "the root element has a namespace, and it should have none",
        );
    }
    element(findings, root, None, &shapes);
    findings.check("modelDescription.xml: elements, attributes and their types");
}

fn element(findings: &mut Findings, node: Node, parent: Option<&str>, shapes: &Shapes) {
    let name = node.tag_name().name();
    let within = parent.map(|parent| format!("{parent}/{name}"));
    let shape = within
        .and_then(|within| shapes.get(within.as_str()))
        .or_else(|| shapes.get(name));
    let Some(shape) = shape else {
        return;
    };
    for attribute in node
        .attributes()
        .filter(|attribute| attribute.namespace().is_none())
    {
        let (known, value) = (attribute.name(), attribute.value());
        if !shape.attributes.iter().any(|(name, _)| *name == known) {
            findings.error(
                &findings.place(node),
                format!("<{name}> has no attribute `{known}`"),
            );
            continue;
        }
        let wrong = if TRUTHS.contains(&known) {
            (!["true", "false", "0", "1"].contains(&value.trim())).then_some("true or false")
        } else if REALS.contains(&known) {
            value.trim().parse::<f64>().is_err().then_some("a number")
        } else if WHOLE.contains(&known) && (known != "value" || name == "Item") {
            value
                .trim()
                .parse::<i64>()
                .is_err()
                .then_some("a whole number")
        } else {
            None
        };
        if let Some(expected) = wrong {
            findings.error(
                &findings.place(node),
                format!("{known}=\"{value}\" of <{name}>: expected {expected}"),
            );
        }
    }
    for (attribute, _) in shape.attributes.iter().filter(|(_, must)| *must) {
        if !node.has_attribute(*attribute) {
            findings.error(
                &findings.place(node),
                format!("<{name}> must have `{attribute}`"),
            );
        }
    }
    let Some(children) = &shape.children else {
        return;
    };
    for child in node.children().filter(Node::is_element) {
        let known = child.tag_name().name();
        if children.iter().any(|(name, _)| *name == known) {
            element(findings, child, Some(name), shapes);
        } else {
            findings.error(
                &findings.place(child),
                format!("<{known}> is not allowed in <{name}>"),
            );
        }
    }
    for (child, _) in children.iter().filter(|(_, must)| *must) {
        if !node.children().any(|node| node.has_tag_name(*child)) {
            findings.error(
                &findings.place(node),
                format!("<{name}> must hold <{child}>"),
            );
        }
    }
}
