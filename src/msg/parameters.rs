//! Wire types of `rcl_interfaces` for parameters, field for field in the order of their `.msg` and `.srv` files.

use serde::{Deserialize, Serialize};

use super::ros::Time;

/// Values of [`ParameterValue::kind`], from `rcl_interfaces/ParameterType`.
pub mod kind {
    /// No value.
    pub const NOT_SET: u8 = 0;
    /// [`bool_value`](super::ParameterValue::bool_value).
    pub const BOOL: u8 = 1;
    /// [`integer_value`](super::ParameterValue::integer_value).
    pub const INTEGER: u8 = 2;
    /// [`double_value`](super::ParameterValue::double_value).
    pub const DOUBLE: u8 = 3;
    /// [`string_value`](super::ParameterValue::string_value).
    pub const STRING: u8 = 4;
    /// [`string_array_value`](super::ParameterValue::string_array_value).
    pub const STRING_ARRAY: u8 = 9;
}

/// `rcl_interfaces/ParameterValue`: one of the fields counts, as `kind` says.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are the types")]
pub struct ParameterValue {
    /// `type`, one of [`kind`].
    pub kind: u8,
    pub bool_value: bool,
    pub integer_value: i64,
    pub double_value: f64,
    pub string_value: String,
    pub byte_array_value: Vec<u8>,
    pub bool_array_value: Vec<bool>,
    pub integer_array_value: Vec<i64>,
    pub double_array_value: Vec<f64>,
    pub string_array_value: Vec<String>,
}

/// `rcl_interfaces/Parameter`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: ParameterValue,
}

/// `rcl_interfaces/FloatingPointRange`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FloatingPointRange {
    /// Least value.
    pub from_value: f64,
    /// Greatest value.
    pub to_value: f64,
    /// Distance between two values; 0 = any.
    pub step: f64,
}

/// `rcl_interfaces/IntegerRange`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IntegerRange {
    /// Least value.
    pub from_value: i64,
    /// Greatest value.
    pub to_value: i64,
    /// Distance between two values; 0 = any.
    pub step: u64,
}

/// `rcl_interfaces/ParameterDescriptor`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterDescriptor {
    /// The parameter.
    pub name: String,
    /// `type`, one of [`kind`].
    pub kind: u8,
    /// What it means.
    pub description: String,
    /// What the ranges cannot say.
    pub additional_constraints: String,
    /// Whether it keeps the value that it has at the start.
    pub read_only: bool,
    /// Whether it may take values of other types.
    pub dynamic_typing: bool,
    /// One where it is a number with bounds.
    pub floating_point_range: Vec<FloatingPointRange>,
    /// One where it is an integer with bounds.
    pub integer_range: Vec<IntegerRange>,
}

/// `rcl_interfaces/SetParametersResult`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetParametersResult {
    /// Whether it was set.
    pub successful: bool,
    /// Why not.
    pub reason: String,
}

/// `rcl_interfaces/ListParametersResult`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListParametersResult {
    /// Names of parameters.
    pub names: Vec<String>,
    /// What stands before the last dot of them.
    pub prefixes: Vec<String>,
}

/// `rcl_interfaces/ParameterEvent`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterEvent {
    /// When.
    pub stamp: Time,
    /// Fully qualified name of the node.
    pub node: String,
    /// Declared since the event before.
    pub new_parameters: Vec<Parameter>,
    /// With another value than before.
    pub changed_parameters: Vec<Parameter>,
    /// Gone.
    pub deleted_parameters: Vec<Parameter>,
}

/// Request of `DescribeParameters`, `GetParameters` and `GetParameterTypes`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Names {
    /// The parameters that are asked for.
    pub names: Vec<String>,
}

/// Request of `ListParameters`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListRequest {
    /// What the names begin with; empty = all.
    pub prefixes: Vec<String>,
    /// Parts of a name, at most; 0 = any number.
    pub depth: u64,
}

/// Request of `SetParameters` and `SetParametersAtomically`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetRequest {
    /// The wanted values.
    pub parameters: Vec<Parameter>,
}

/// Response of `GetParameters`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetResponse {
    /// Of each name; empty where one of them is unknown.
    pub values: Vec<ParameterValue>,
}

/// Response of `GetParameterTypes`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TypesResponse {
    /// Of each name, one of [`kind`]; empty where one of them is unknown.
    pub types: Vec<u8>,
}

/// Response of `DescribeParameters`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DescribeResponse {
    /// Of each name; empty where one of them is unknown.
    pub descriptors: Vec<ParameterDescriptor>,
}

/// Response of `ListParameters`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListResponse {
    /// What was found.
    pub result: ListParametersResult,
}

/// Response of `SetParameters`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetResponse {
    /// Of each wanted value.
    pub results: Vec<SetParametersResult>,
}

/// Response of `SetParametersAtomically`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetAtomicallyResponse {
    /// Of all values.
    pub result: SetParametersResult,
}

#[cfg(test)]
mod tests {
    use std::fmt::Debug;

    use byteorder::LittleEndian;
    use serde::de::DeserializeOwned;

    use super::*;

    /// Writes and reads; returns the bytes.
    fn round_trip<T: Serialize + DeserializeOwned + PartialEq + Debug>(message: &T) -> Vec<u8> {
        let bytes = cdr_encoding::to_vec::<T, LittleEndian>(message).unwrap();
        let (read, length) = cdr_encoding::from_bytes::<T, LittleEndian>(&bytes).unwrap();
        assert_eq!((&read, length), (message, bytes.len()));
        bytes
    }

    fn parameter() -> Parameter {
        let value = ParameterValue {
            kind: kind::DOUBLE,
            double_value: 2.5,
            string_array_value: vec!["a".into()],
            ..ParameterValue::default()
        };
        Parameter { name: "max_range".to_owned(), value }
    }

    fn words(words: &[&str]) -> Vec<String> {
        words.iter().map(|&word| word.to_owned()).collect()
    }

    #[test]
    fn a_parameter_goes_through_cdr_with_its_fields_where_ros_has_them() {
        let bytes = round_trip(&parameter());
        // A length, the name and its end, up to 14 bytes; the kind, the boolean; numbers at multiples of 8.
        assert_eq!(&bytes[4..14], b"max_range\0");
        assert_eq!((bytes[14], bytes[15]), (kind::DOUBLE, 0));
        assert_eq!(bytes[24..32], 2.5_f64.to_le_bytes());
    }

    #[test]
    fn a_descriptor_goes_through_cdr() {
        round_trip(&DescribeResponse {
            descriptors: vec![ParameterDescriptor {
                name: "depth".to_owned(),
                kind: kind::INTEGER,
                description: "steps".to_owned(),
                additional_constraints: "c".to_owned(),
                read_only: true,
                dynamic_typing: false,
                floating_point_range: vec![FloatingPointRange { from_value: 0.0, to_value: 1.0, step: 0.0 }],
                integer_range: vec![IntegerRange { from_value: 1, to_value: 8, step: 0 }],
            }],
        });
    }

    #[test]
    fn an_event_goes_through_cdr() {
        let (stamp, node) = (Time { sec: 7, nanosec: 9 }, "/cfodi".to_owned());
        let changed_parameters = vec![parameter()];
        round_trip(&ParameterEvent { stamp, node, changed_parameters, ..ParameterEvent::default() });
    }

    #[test]
    fn requests_go_through_cdr() {
        round_trip(&Names { names: words(&["a", "", "b"]) });
        round_trip(&ListRequest { prefixes: words(&["front"]), depth: 3 });
        round_trip(&SetRequest { parameters: vec![parameter(), Parameter::default()] });
    }

    #[test]
    fn responses_go_through_cdr() {
        let result = SetParametersResult { successful: false, reason: "why".to_owned() };
        round_trip(&GetResponse { values: vec![parameter().value] });
        round_trip(&TypesResponse { types: vec![1, 2, 9] });
        let found = ListParametersResult { names: words(&["a.b"]), prefixes: words(&["a"]) };
        round_trip(&ListResponse { result: found });
        round_trip(&SetResponse { results: vec![result.clone(), SetParametersResult::default()] });
        round_trip(&SetAtomicallyResponse { result });
    }
}
