//! Protobuf as far as recordings need it: fields one after the other, and schemas of numbers. A
//! library is a large build for that; programs that plot a recording (Foxglove, Rerun,
//! PlotJuggler) read numbers from Protobuf without further instructions.

/// Fields of a Protobuf message, one after the other.
#[derive(Default)]
pub struct Fields(Vec<u8>);

impl Fields {
    /// The message.
    pub fn bytes(self) -> Vec<u8> {
        self.0
    }

    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    /// A field of bytes: a text or another message.
    pub fn part(mut self, field: u64, bytes: &[u8]) -> Self {
        self.varint(field << 3 | 2);
        self.varint(bytes.len() as u64);
        self.0.extend(bytes);
        self
    }

    /// A field of a whole number.
    pub fn integer(mut self, field: u64, value: u64) -> Self {
        self.varint(field << 3);
        self.varint(value);
        self
    }

    /// A field of a double.
    pub fn double(mut self, field: u64, value: f64) -> Self {
        self.varint(field << 3 | 1);
        self.0.extend(value.to_le_bytes());
        self
    }

    /// Fields 1, 2 and so on, each a double.
    pub fn doubles(self, values: &[f64]) -> Self {
        (1..).zip(values).fold(self, |fields, (field, value)| fields.double(field, *value))
    }
}

/// Returns the `FileDescriptorSet` of a message `package.name` whose fields 1, 2 and so on are
/// doubles with these names.
pub fn numbers(package: &str, name: &str, fields: &[&str]) -> Vec<u8> {
    // label: optional, type: double.
    let field = |(number, name): (u64, &&str)| {
        Fields::default().part(1, name.as_bytes()).integer(3, number).integer(4, 1).integer(5, 1).bytes()
    };
    let all = (1..).zip(fields).map(field);
    let message = all.fold(Fields::default().part(1, name.as_bytes()), |it, field| it.part(2, &field));
    let file = Fields::default()
        .part(1, format!("{package}/{name}.proto").as_bytes())
        .part(2, package.as_bytes())
        .part(4, &message.bytes())
        .part(12, b"proto3");
    Fields::default().part(1, &file.bytes()).bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_varint_is_the_published_one() {
        for (value, bytes) in [(0, vec![0]), (1, vec![1]), (150, vec![0x96, 1]), (300, vec![0xac, 2])] {
            let mut fields = Fields::default();
            fields.varint(value);
            assert_eq!(fields.0, bytes, "{value}");
        }
    }
}
