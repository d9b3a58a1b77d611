//! Messages of ROS 2 bags: CDR, by the definition that the bag holds; only where the program was
//! built with the feature `ros`.

use re_cdr::{BigEndian, CdrReader, LittleEndian};
use re_ros_msg::MessageSchema;
use re_ros_msg::deserialize::primitive_array::PrimitiveArray;
use re_ros_msg::deserialize::{MapResolver, Value, decode_message};
use serde_json::{Map, Value as Json};

/// Bytes before a message: how it is encoded.
const HEADER: usize = 4;

/// Reads messages of one type.
pub(super) struct Decoder {
    schema: MessageSchema,
}

impl Decoder {
    /// A decoder for the type `name` as `text` defines it; none where that is no definition.
    pub(super) fn new(name: &str, text: &[u8]) -> Option<Self> {
        let schema = MessageSchema::parse(&short(name), std::str::from_utf8(text).ok()?).ok()?;
        Some(Self { schema })
    }

    /// A message as JSON, its arrays by their elements' names where it names them; none where it is
    /// damaged.
    pub(super) fn decode(&self, data: &[u8]) -> Option<Json> {
        let specs = std::iter::once(&self.schema.spec).chain(&self.schema.dependencies);
        let resolver = MapResolver::new(specs.map(|spec| (short(&spec.name), spec)));
        let (header, body) = data.split_at_checked(HEADER)?;
        let value = if header[1] & 1 == 1 {
            decode_message(&mut CdrReader::<LittleEndian>::new(body), &self.schema.spec, &resolver)
        } else {
            decode_message(&mut CdrReader::<BigEndian>::new(body), &self.schema.spec, &resolver)
        };
        Some(json(&value.ok()?))
    }
}

/// `sensor_msgs/msg/JointState` as definitions refer to it: `sensor_msgs/JointState`.
fn short(name: &str) -> String {
    name.replace("/msg/", "/")
}

fn json(value: &Value) -> Json {
    match value {
        Value::Bool(x) => Json::from(*x),
        Value::I8(x) => Json::from(*x),
        Value::U8(x) => Json::from(*x),
        Value::I16(x) => Json::from(*x),
        Value::U16(x) => Json::from(*x),
        Value::I32(x) => Json::from(*x),
        Value::U32(x) => Json::from(*x),
        Value::I64(x) => Json::from(*x),
        Value::U64(x) => Json::from(*x),
        Value::F32(x) => Json::from(f64::from(*x)),
        Value::F64(x) => Json::from(*x),
        Value::String(x) => Json::from(x.clone()),
        Value::Array(items) | Value::Sequence(items) => items.iter().map(json).collect(),
        Value::PrimitiveArray(items) | Value::PrimitiveSeq(items) => array(items),
        Value::Message(fields) => {
            let mut map: Map<String, Json> =
                fields.iter().map(|(name, value)| (name.clone(), json(value))).collect();
            by_joint(&mut map);
            Json::Object(map)
        }
    }
}

fn array(items: &PrimitiveArray) -> Json {
    match items {
        PrimitiveArray::Bool(x) => Json::from(x.clone()),
        PrimitiveArray::I8(x) => Json::from(x.clone()),
        // Pictures and clouds of points, more often than numbers.
        PrimitiveArray::U8(_) => Json::Null,
        PrimitiveArray::I16(x) => Json::from(x.clone()),
        PrimitiveArray::U16(x) => Json::from(x.clone()),
        PrimitiveArray::I32(x) => Json::from(x.clone()),
        PrimitiveArray::U32(x) => Json::from(x.clone()),
        PrimitiveArray::I64(x) => Json::from(x.clone()),
        PrimitiveArray::U64(x) => Json::from(x.clone()),
        PrimitiveArray::F32(x) => x.iter().map(|x| f64::from(*x)).collect(),
        PrimitiveArray::F64(x) => Json::from(x.clone()),
        PrimitiveArray::String(x) => Json::from(x.clone()),
    }
}

/// Names the elements of a message's arrays by its `name` or `joint_names`, as a joint state has
/// them.
fn by_joint(map: &mut Map<String, Json>) {
    let names = ["name", "joint_names"].into_iter().find_map(|key| map.get(key)?.as_array().cloned());
    let Some(names) = names.filter(|names| !names.is_empty() && names.iter().all(Json::is_string)) else {
        return;
    };
    for value in map.values_mut() {
        if let Json::Array(items) = value
            && items.len() == names.len()
            && items.iter().all(Json::is_number)
        {
            let named = names.iter().filter_map(Json::as_str).map(str::to_owned).zip(std::mem::take(items));
            *value = Json::Object(named.collect());
        }
    }
}
