#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace trammel::test {

using PacketBytes = std::vector<unsigned char>;
using Prefix = std::array<unsigned char, 12>;

/// Little endian, as most hosts send.
void put16(PacketBytes& bytes, std::uint32_t value);
void put32(PacketBytes& bytes, std::uint32_t value);
/// A sequence number: its high half first.
void put_number(PacketBytes& bytes, std::int64_t number);
/// An entity id, its first octet the highest.
void put_entity(PacketBytes& bytes, std::uint32_t entity);
void put_bytes(PacketBytes& bytes, const PacketBytes& more);

/// A list of parameters (RTPS 2.3, 9.4.2.11).
class ParameterList {
 public:
  /// Padded to a multiple of 4.
  ParameterList& add(std::uint16_t id, PacketBytes value);
  ParameterList& number(std::uint16_t id, std::uint32_t value);
  ParameterList& text(std::uint16_t id, const std::string& value);
  ParameterList& guid(std::uint16_t id, const Prefix& prefix, std::uint32_t entity);
  /// IPv4 over UDP on 127.0.0.1.
  ParameterList& locator(std::uint16_t id, std::uint16_t port);
  /// With its sentinel.
  [[nodiscard]] PacketBytes bytes() const;
  /// With the head of a serialized list in front.
  [[nodiscard]] PacketBytes payload() const;

 private:
  PacketBytes bytes_;
};

struct DataFields {
  std::uint32_t reader = 0, writer = 0;
  std::int64_t number = 1;
  PacketBytes inline_qos = {};  ///< none when empty
  PacketBytes payload = {};     ///< none when empty
};
struct FragmentFields {
  std::uint32_t reader = 0, writer = 0;
  std::int64_t number = 1;
  std::uint32_t first = 1;
  std::uint16_t count = 1, size = 1024;
  std::uint32_t sample_size = 4096;
  PacketBytes payload = {};
};

/// An RTPS message, put together without any check.
class Packet {
 public:
  explicit Packet(const Prefix& from);

  Packet& submessage(unsigned char id, unsigned char flags, const PacketBytes& body);
  Packet& to(const Prefix& participant);
  Packet& data(const DataFields& fields);
  Packet& fragments(const FragmentFields& fields);
  Packet& heartbeat(std::uint32_t reader, std::uint32_t writer, std::int64_t first,
                    std::int64_t last, std::uint32_t count);
  Packet& gap(std::uint32_t reader, std::uint32_t writer, std::int64_t start, std::int64_t base);
  Packet& acknack(std::uint32_t reader, std::uint32_t writer, std::int64_t base, std::uint32_t bits,
                  std::uint32_t count);
  /// Asks for the fragment `base`.
  Packet& nack_frag(std::uint32_t reader, std::uint32_t writer, std::int64_t number,
                    std::uint32_t base, std::uint32_t count);
  [[nodiscard]] const PacketBytes& bytes() const { return bytes_; }

 private:
  PacketBytes bytes_;
};

}  // namespace trammel::test
