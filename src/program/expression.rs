//! Expressions in brackets: `[#1 + 2 * SIN[30]] / 3`. Angles in degrees.
//!
//! A Pratt parser that computes while it reads. A tree would be built anew for each pass of a loop, because
//! values are bound to the line; a parser crate would add a layer for five levels of operators, and its
//! errors would not know the column. The levels are those of LinuxCNC: `**`, then `* / MOD`, then `+ -`, then
//! comparisons, then `AND OR XOR`. Fanuc's are the same without `**`.

use crate::control::Logic;
use crate::cursor::Cursor;
use crate::error::{Fault, Stop};
use crate::parameters::{Parameters, index, name};

/// Brackets within brackets. Each takes some hundred bytes of the stack.
const DEEPEST: usize = 60;

/// A value, or none: an empty parameter of Fanuc.
pub(crate) type Value = Option<f64>;

/// What expressions are read with.
#[derive(Clone, Copy)]
pub(crate) struct Scope<'a> {
    /// The variables.
    pub parameters: &'a Parameters,
    /// What belongs to the control: current position, offsets, modal codes.
    pub system: &'a dyn Fn(u32) -> System,
    /// What some functions and operators compute.
    pub logic: Logic,
}

/// A variable, as the control has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum System {
    /// It belongs to the program.
    Free,
    /// It belongs to the control.
    Value(f64),
    /// It belongs to the control, and its value is not known.
    Unknown,
}

/// Reads a number, a parameter, a function or an expression in brackets, with signs before it.
pub(crate) fn operand(text: &mut Cursor<'_>, scope: Scope<'_>, depth: usize) -> Result<Value, Stop> {
    if depth > DEEPEST {
        return Err(text.stop(Fault::Deep(DEEPEST)));
    }
    text.skip_blanks();
    match text.peek() {
        Some(b'-') => {
            text.next();
            Ok(operand(text, scope, depth + 1)?.map(|value| -value))
        }
        Some(b'+') => {
            text.next();
            operand(text, scope, depth + 1)
        }
        Some(b'[') => bracket(text, scope, depth + 1),
        Some(b'#') => parameter(text, scope, depth),
        Some(b'0'..=b'9' | b'.') => text.number().map(Some),
        Some(b) if b.is_ascii_alphabetic() => function(text, scope, depth),
        _ => Err(text.stop(Fault::Expected("a number, #, [ or a function"))),
    }
}

/// Reads operands that operators join, without brackets around them.
pub(crate) fn open(text: &mut Cursor<'_>, scope: Scope<'_>) -> Result<Value, Stop> {
    levels(text, scope, 0, 0)
}

/// Reads `[…]`.
pub(crate) fn bracket(text: &mut Cursor<'_>, scope: Scope<'_>, depth: usize) -> Result<Value, Stop> {
    text.expect(b'[', "[")?;
    let value = levels(text, scope, 0, depth)?;
    text.expect(b']', "]")?;
    Ok(value)
}

/// A binary operator.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Operator {
    Power,
    Times,
    Over,
    Modulo,
    Plus,
    Minus,
    Equal,
    NotEqual,
    Greater,
    AtLeast,
    Less,
    AtMost,
    And,
    Or,
    ExclusiveOr,
}

/// The words and how strongly they bind.
const OPERATORS: [(&[u8], Operator, u8); 15] = [
    (b"**", Operator::Power, 5),
    (b"*", Operator::Times, 4),
    (b"/", Operator::Over, 4),
    (b"MOD", Operator::Modulo, 4),
    (b"+", Operator::Plus, 3),
    (b"-", Operator::Minus, 3),
    (b"EQ", Operator::Equal, 2),
    (b"NE", Operator::NotEqual, 2),
    (b"GT", Operator::Greater, 2),
    (b"GE", Operator::AtLeast, 2),
    (b"LT", Operator::Less, 2),
    (b"LE", Operator::AtMost, 2),
    (b"AND", Operator::And, 1),
    (b"OR", Operator::Or, 1),
    (b"XOR", Operator::ExclusiveOr, 1),
];

/// Operands joined by operators that bind more strongly than `above`.
fn levels(text: &mut Cursor<'_>, scope: Scope<'_>, above: u8, depth: usize) -> Result<Value, Stop> {
    let mut left = operand(text, scope, depth)?;
    loop {
        text.skip_blanks();
        let found = OPERATORS.iter().find(|(word, ..)| text.starts_with(word));
        let Some((word, operator, level)) = found.filter(|(.., level)| *level > above) else {
            return Ok(left);
        };
        let column = text.at();
        text.advance(word.len());
        let right = levels(text, scope, *level, depth + 1)?;
        left = Some(apply(*operator, left, right, scope.logic, column)?);
    }
}

fn apply(operator: Operator, left: Value, right: Value, logic: Logic, column: usize) -> Result<f64, Stop> {
    let (a, b) = (left.unwrap_or(0.0), right.unwrap_or(0.0));
    let truth = |holds: bool| if holds { 1.0 } else { 0.0 };
    // An empty parameter equals nothing but an empty one.
    let alike = left.is_some() == right.is_some() && (a - b).abs() < 1e-9;
    let value = match operator {
        Operator::Power => a.powf(b),
        Operator::Times => a * b,
        Operator::Over if b == 0.0 => return Err(Stop::new(column, Fault::Zero)),
        Operator::Over => a / b,
        Operator::Modulo if b == 0.0 => return Err(Stop::new(column, Fault::Zero)),
        Operator::Modulo => a.rem_euclid(b),
        Operator::Plus => a + b,
        Operator::Minus => a - b,
        Operator::Equal => truth(alike),
        Operator::NotEqual => truth(!alike),
        Operator::Greater => truth(a > b),
        Operator::AtLeast => truth(a >= b),
        Operator::Less => truth(a < b),
        Operator::AtMost => truth(a <= b),
        Operator::And | Operator::Or | Operator::ExclusiveOr => {
            return logical(operator, a, b, logic, column);
        }
    };
    finite(value, "the power", a, column)
}

/// AND, OR and XOR: of true and false, or bit by bit.
fn logical(operator: Operator, a: f64, b: f64, logic: Logic, column: usize) -> Result<f64, Stop> {
    let plain = [a, b].iter().all(|x| *x == 0.0 || *x == 1.0);
    if logic == Logic::Either && !plain {
        return Err(Stop::new(column, Fault::Disputed("AND, OR and XOR of other numbers than 0 and 1")));
    }
    let bits = |x: f64| {
        if logic != Logic::Bits {
            return Ok(u32::from(x != 0.0));
        }
        let whole = x.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&x);
        let fault = Fault::Domain { what: "the bits", value: x };
        if whole { Ok(x as u32) } else { Err(Stop::new(column, fault)) }
    };
    let (a, b) = (bits(a)?, bits(b)?);
    Ok(f64::from(match operator {
        Operator::And => a & b,
        Operator::Or => a | b,
        _ => a ^ b,
    }))
}

fn finite(value: f64, what: &'static str, of: f64, column: usize) -> Result<f64, Stop> {
    if value.is_finite() { Ok(value) } else { Err(Stop::new(column, Fault::Domain { what, value: of })) }
}

/// Reads `#5`, `##2`, `#[…]` or `#<name>` and gives its value.
fn parameter(text: &mut Cursor<'_>, scope: Scope<'_>, depth: usize) -> Result<Value, Stop> {
    let column = text.at();
    text.next();
    text.skip_blanks();
    if text.peek() == Some(b'<') {
        let name = angled(text)?;
        let value = scope.parameters.named(&name).or_else(|| predefined(&name, scope));
        return value.map(Some).ok_or_else(|| Stop::new(column, Fault::Unset(name)));
    }
    let number = operand(text, scope, depth + 1)?.unwrap_or(0.0);
    let number = index(number, column)?;
    match (scope.system)(number) {
        System::Free => Ok(scope.parameters.get(number)),
        System::Value(value) => Ok(Some(value)),
        System::Unknown => Err(Stop::new(column, Fault::System(number))),
    }
}

/// Names that the control gives values to.
fn predefined(name: &str, scope: Scope<'_>) -> Option<f64> {
    let number = match name {
        "_x" => 5420,
        "_y" => 5421,
        "_z" => 5422,
        "_a" => 5423,
        "_b" => 5424,
        "_c" => 5425,
        "_current_tool" => 5400,
        "_coord_system" => 5220,
        _ => return None,
    };
    match (scope.system)(number) {
        System::Value(value) => Some(value),
        _ => None,
    }
}

/// Reads `<name>`.
pub(crate) fn angled(text: &mut Cursor<'_>) -> Result<String, Stop> {
    text.expect(b'<', "<")?;
    let rest = text.rest();
    let Some(end) = rest.iter().position(|b| *b == b'>') else { return Err(text.stop(Fault::Expected(">"))) };
    let found = name(&rest[..end]);
    text.advance(end + 1);
    Ok(found)
}

fn function(text: &mut Cursor<'_>, scope: Scope<'_>, depth: usize) -> Result<Value, Stop> {
    let column = text.at();
    let word = text.letters();
    if word == "EXISTS" {
        return exists(text, scope, depth).map(Some);
    }
    if !FUNCTIONS.contains(&word.as_str()) {
        return Err(Stop::new(column, Fault::Function(word)));
    }
    text.skip_blanks();
    let x = bracket(text, scope, depth + 1)?.unwrap_or(0.0);
    let value = match word.as_str() {
        "ATAN" => {
            text.skip_blanks();
            // LinuxCNC and Fanuc write ATAN[y]/[x].
            if text.peek() == Some(b'/') {
                text.next();
                text.skip_blanks();
                let across = bracket(text, scope, depth + 1)?.unwrap_or(0.0);
                x.atan2(across).to_degrees()
            } else {
                x.atan().to_degrees()
            }
        }
        "ABS" => x.abs(),
        "ACOS" => x.acos().to_degrees(),
        "ASIN" => x.asin().to_degrees(),
        "COS" => x.to_radians().cos(),
        "EXP" => x.exp(),
        "FIX" | "FUP" if scope.logic == Logic::Either && x < 0.0 && x.fract() != 0.0 => {
            return Err(Stop::new(column, Fault::Disputed("FIX and FUP of negative numbers")));
        }
        "FIX" if scope.logic == Logic::Truth => x.floor(),
        "FUP" if scope.logic == Logic::Truth => x.ceil(),
        "FIX" => x.trunc(),
        "FUP" => x.abs().ceil().copysign(x),
        "LN" => x.ln(),
        "ROUND" => x.round(),
        "SIN" => x.to_radians().sin(),
        "SQRT" => x.sqrt(),
        _ => x.to_radians().tan(),
    };
    let what = FUNCTIONS.iter().find(|known| **known == word).copied().unwrap_or("the function");
    finite(value, what, x, column).map(Some)
}

/// The functions.
const FUNCTIONS: [&str; 13] =
    ["ABS", "ACOS", "ASIN", "ATAN", "COS", "EXP", "FIX", "FUP", "LN", "ROUND", "SIN", "SQRT", "TAN"];

/// `EXISTS[#<name>]`.
fn exists(text: &mut Cursor<'_>, scope: Scope<'_>, depth: usize) -> Result<f64, Stop> {
    text.skip_blanks();
    text.expect(b'[', "[")?;
    text.skip_blanks();
    text.expect(b'#', "#")?;
    text.skip_blanks();
    let there = if text.peek() == Some(b'<') {
        let name = angled(text)?;
        scope.parameters.named(&name).or_else(|| predefined(&name, scope)).is_some()
    } else {
        let column = text.at();
        let number = index(operand(text, scope, depth + 1)?.unwrap_or(0.0), column)?;
        scope.parameters.get(number).is_some()
    };
    text.skip_blanks();
    text.expect(b']', "]")?;
    Ok(f64::from(u8::from(there)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Target;

    fn value(text: &str) -> Result<Value, Stop> {
        value_by(text, Logic::Truth)
    }

    fn value_by(text: &str, logic: Logic) -> Result<Value, Stop> {
        let mut parameters = Parameters::new(33);
        parameters.set(&Target::Number(1), Some(2.0));
        parameters.set(&Target::Number(2), Some(100.0));
        parameters.set(&Target::Number(102), Some(9.0));
        parameters.set(&Target::Name("feed".into()), Some(250.0));
        let scope = Scope { parameters: &parameters, system: &|_| System::Free, logic };
        operand(&mut Cursor::new(text.as_bytes()), scope, 0)
    }

    #[test]
    fn operators_bind_as_controls_have_it() {
        for (text, expected) in [
            ("[1 + 2 * 3]", 7.0),
            ("[2 ** 3 ** 2]", 64.0),
            ("[10 - 4 - 3]", 3.0),
            ("[7 MOD 4]", 3.0),
            ("[-7 MOD 4]", 1.0),
            ("[1 LT 2 AND 2 LT 1]", 0.0),
            ("[1 LT 2 OR 2 LT 1]", 1.0),
            ("[1 XOR 1]", 0.0),
            ("#1", 2.0),
            ("#[#2 + #1]", 9.0),
            ("-#1", -2.0),
            ("#< Feed >", 250.0),
            ("[SIN[30] + cos[60]]", 1.0),
            ("ATAN[1]/[-1]", 135.0),
            ("[ROUND[2.5] + FIX[-1.5] + FUP[1.2]]", 3.0),
            ("SQRT[16]", 4.0),
            ("[EXISTS[#<feed>] + EXISTS[#<none>]]", 1.0),
            ("[#5 EQ 0]", 0.0),
            ("[#5 + 1]", 1.0),
        ] {
            let found = value(text).unwrap().unwrap();
            assert!((found - expected).abs() < 1e-12, "{text}: {found}");
        }
    }

    #[test]
    fn controls_round_and_join_bits_in_their_own_ways() {
        for (text, truth, bits) in [
            ("FIX[-1.5]", -2.0, -1.0),
            ("FUP[-1.2]", -1.0, -2.0),
            ("FIX[1.5]", 1.0, 1.0),
            ("FUP[1.2]", 2.0, 2.0),
            ("[7 AND 2]", 1.0, 2.0),
            ("[5 OR 2]", 1.0, 7.0),
            ("[5 XOR 4]", 0.0, 1.0),
            ("[1 AND 0]", 0.0, 0.0),
        ] {
            for (logic, expected) in [(Logic::Truth, truth), (Logic::Bits, bits)] {
                assert_eq!(value_by(text, logic), Ok(Some(expected)), "{text} {logic:?}");
            }
            match value_by(text, Logic::Either) {
                Ok(found) => assert_eq!((found, truth), (Some(truth), bits), "{text}"),
                Err(stop) => assert!(truth != bits || text.contains('7'), "{text} {}", stop.fault),
            }
        }
        assert!(matches!(*value_by("[0.5 AND 1]", Logic::Bits).unwrap_err().fault, Fault::Domain { .. }));
    }

    #[test]
    fn faults_have_a_column() {
        for (text, column, fault) in [
            ("[1 / 0]", 3, Fault::Zero),
            ("[1 +]", 4, Fault::Expected("a number, #, [ or a function")),
            ("[1 + 2", 6, Fault::Expected("]")),
            ("FOO[1]", 0, Fault::Function("FOO".into())),
            ("SQRT[-1]", 0, Fault::Domain { what: "SQRT", value: -1.0 }),
            ("#<none>", 0, Fault::Unset("none".into())),
            ("#[1.5]", 0, Fault::Parameter(1.5)),
        ] {
            let stop = value(text).unwrap_err();
            assert_eq!((stop.column, *stop.fault), (column, fault), "{text}");
        }
        assert!(matches!(*value(&"[".repeat(1000)).unwrap_err().fault, Fault::Deep(_)));
        assert!(matches!(*value(&"-".repeat(1000)).unwrap_err().fault, Fault::Deep(_)));
        assert!(matches!(*value(&"#".repeat(1000)).unwrap_err().fault, Fault::Deep(_)));
    }
}
