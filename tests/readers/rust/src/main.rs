//! Prints what an MCAP file of protobuf messages holds, as JSON: by topic its schema, how many messages
//! there are, and the last one, decoded by the schema in the file. Fails if any checksum does not match.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use prost_reflect::{DescriptorPool, DynamicMessage, SerializeOptions};
use serde_json::{json, Value};

fn main() -> Result<()> {
    let path = std::env::args()
        .nth(1)
        .context("expected the path of an MCAP file")?;
    let topics = read(&std::fs::read(path)?)?;
    println!("{}", json!(topics));
    Ok(())
}

fn read(content: &[u8]) -> Result<BTreeMap<String, Value>> {
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = LinearReader::new_with_options(options);
    let mut rest = content;
    let (mut schemas, mut channels, mut last) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record { data, opcode } => match mcap::parse_record(opcode, data)?
                .into_owned()
            {
                Record::Schema { header, data } => {
                    schemas.insert(header.id, (header, data));
                }
                Record::Channel(channel) => {
                    channels.insert(channel.id, channel);
                }
                Record::Message { header, data } => {
                    let (count, newest) = last.entry(header.channel_id).or_insert((0, Vec::new()));
                    *count += 1;
                    *newest = data.to_vec();
                }
                _ => {}
            },
        }
    }
    let mut topics = BTreeMap::new();
    for (id, (messages, newest)) in last {
        let channel = &channels[&id];
        let (schema, descriptors) = &schemas[&channel.schema_id];
        let topic = json!({
            "schema": schema.name,
            "schema_encoding": schema.encoding,
            "message_encoding": channel.message_encoding,
            "messages": messages,
            "last": decoded(descriptors, &schema.name, &newest)?,
        });
        topics.insert(channel.topic.clone(), topic);
    }
    Ok(topics)
}

fn decoded(descriptors: &[u8], name: &str, message: &[u8]) -> Result<Value> {
    let kind = DescriptorPool::decode(descriptors)?
        .get_message_by_name(name)
        .with_context(|| format!("{name} is not in its own schema"))?;
    let options = SerializeOptions::new()
        .use_proto_field_name(true)
        .skip_default_fields(false);
    Ok(DynamicMessage::decode(kind, message)?
        .serialize_with_options(serde_json::value::Serializer, &options)?)
}
