#include "tests/support/rtps_packet.h"

namespace trammel::test {

void put16(PacketBytes& bytes, std::uint32_t value) {
  for (unsigned i = 0; i < 2; ++i) bytes.push_back(static_cast<unsigned char>(value >> 8 * i));
}
void put32(PacketBytes& bytes, std::uint32_t value) {
  for (unsigned i = 0; i < 4; ++i) bytes.push_back(static_cast<unsigned char>(value >> 8 * i));
}
void put_number(PacketBytes& bytes, std::int64_t number) {
  put32(bytes, static_cast<std::uint32_t>(static_cast<std::uint64_t>(number) >> 32));
  put32(bytes, static_cast<std::uint32_t>(number));
}
void put_entity(PacketBytes& bytes, std::uint32_t entity) {
  for (unsigned i = 0; i < 4; ++i)
    bytes.push_back(static_cast<unsigned char>(entity >> 8 * (3 - i)));
}
void put_bytes(PacketBytes& bytes, const PacketBytes& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

ParameterList& ParameterList::add(std::uint16_t id, PacketBytes value) {
  while (value.size() % 4 != 0) value.push_back(0);
  put16(bytes_, id);
  put16(bytes_, static_cast<std::uint32_t>(value.size()));
  put_bytes(bytes_, value);
  return *this;
}
ParameterList& ParameterList::number(std::uint16_t id, std::uint32_t value) {
  PacketBytes bytes;
  put32(bytes, value);
  return add(id, bytes);
}
ParameterList& ParameterList::text(std::uint16_t id, const std::string& value) {
  PacketBytes bytes;
  put32(bytes, static_cast<std::uint32_t>(value.size() + 1));
  bytes.insert(bytes.end(), value.begin(), value.end());
  bytes.push_back(0);
  return add(id, bytes);
}
ParameterList& ParameterList::guid(std::uint16_t id, const Prefix& prefix, std::uint32_t entity) {
  PacketBytes bytes(prefix.begin(), prefix.end());
  put_entity(bytes, entity);
  return add(id, bytes);
}
ParameterList& ParameterList::locator(std::uint16_t id, std::uint16_t port) {
  PacketBytes bytes;
  put32(bytes, 1);
  put32(bytes, port);
  bytes.resize(bytes.size() + 12);
  put32(bytes, 0x0100007f);
  return add(id, bytes);
}
PacketBytes ParameterList::bytes() const {
  PacketBytes bytes = bytes_;
  put32(bytes, 1);
  return bytes;
}
PacketBytes ParameterList::payload() const {
  PacketBytes bytes;
  put32(bytes, 0x00000300);
  put_bytes(bytes, this->bytes());
  return bytes;
}

Packet::Packet(const Prefix& from) {
  bytes_.reserve(512);
  for (const char byte : {'R', 'T', 'P', 'S'}) bytes_.push_back(static_cast<unsigned char>(byte));
  for (const int byte : {2, 3, 1, 15}) bytes_.push_back(static_cast<unsigned char>(byte));
  for (const unsigned char byte : from) bytes_.push_back(byte);
}
Packet& Packet::submessage(unsigned char id, unsigned char flags, const PacketBytes& body) {
  bytes_.push_back(id);
  bytes_.push_back(flags);
  put16(bytes_, static_cast<std::uint32_t>(body.size()));
  put_bytes(bytes_, body);
  return *this;
}
Packet& Packet::to(const Prefix& participant) {
  return submessage(0x0e, 1, PacketBytes(participant.begin(), participant.end()));
}
Packet& Packet::data(const DataFields& fields) {
  PacketBytes body;
  put16(body, 0);
  put16(body, 16);
  put_entity(body, fields.reader);
  put_entity(body, fields.writer);
  put_number(body, fields.number);
  put_bytes(body, fields.inline_qos);
  put_bytes(body, fields.payload);
  while (body.size() % 4 != 0) body.push_back(0);
  return submessage(0x15,
                    static_cast<unsigned char>(1 | (fields.inline_qos.empty() ? 0 : 2) |
                                               (fields.payload.empty() ? 0 : 4)),
                    body);
}
Packet& Packet::fragments(const FragmentFields& fields) {
  PacketBytes body;
  put16(body, 0);
  put16(body, 28);
  put_entity(body, fields.reader);
  put_entity(body, fields.writer);
  put_number(body, fields.number);
  put32(body, fields.first);
  put16(body, fields.count);
  put16(body, fields.size);
  put32(body, fields.sample_size);
  put_bytes(body, fields.payload);
  return submessage(0x16, 1, body);
}
Packet& Packet::heartbeat(std::uint32_t reader, std::uint32_t writer, std::int64_t first,
                          std::int64_t last, std::uint32_t count) {
  PacketBytes body;
  put_entity(body, reader);
  put_entity(body, writer);
  put_number(body, first);
  put_number(body, last);
  put32(body, count);
  return submessage(0x07, 1, body);
}
Packet& Packet::gap(std::uint32_t reader, std::uint32_t writer, std::int64_t start,
                    std::int64_t base) {
  PacketBytes body;
  put_entity(body, reader);
  put_entity(body, writer);
  put_number(body, start);
  put_number(body, base);
  put32(body, 0);
  return submessage(0x08, 1, body);
}
Packet& Packet::acknack(std::uint32_t reader, std::uint32_t writer, std::int64_t base,
                        std::uint32_t bits, std::uint32_t count) {
  PacketBytes body;
  put_entity(body, reader);
  put_entity(body, writer);
  put_number(body, base);
  put32(body, bits);
  body.resize(body.size() + (bits + 31) / 32 * 4, 0xff);
  put32(body, count);
  return submessage(0x06, 1, body);
}
Packet& Packet::nack_frag(std::uint32_t reader, std::uint32_t writer, std::int64_t number,
                          std::uint32_t base, std::uint32_t count) {
  PacketBytes body;
  put_entity(body, reader);
  put_entity(body, writer);
  put_number(body, number);
  put32(body, base);
  put32(body, 1);
  put32(body, 0x80000000u);
  put32(body, count);
  return submessage(0x12, 1, body);
}

}  // namespace trammel::test
