#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "idl/repairs/guard/rtps_bytes.h"

namespace trammel::wire {

/// A received message of which a few bytes may have to be changed. It is copied when the first one
/// is, into memory of the calling thread: at most one message of a thread is edited at a time.
class EditedMessage {
 public:
  static constexpr std::size_t kMost = 65536;  ///< bytes; a datagram has fewer

  explicit EditedMessage(Bytes original) : original_(original) {}

  /// `part` is a part of the original message; `bytes` replaces what is there.
  void put(Bytes part, Bytes bytes) {
    unsigned char* const copy = storage().data();
    if (!edited_) std::copy(original_.begin(), original_.end(), copy);
    edited_ = true;
    std::copy(bytes.begin(), bytes.end(), copy + (part.data() - original_.data()));
  }
  void put(Bytes part, std::uint16_t value, bool little_endian) {
    const auto low = static_cast<unsigned char>(value),
               high = static_cast<unsigned char>(value >> 8);
    put(part, little_endian ? std::array{low, high} : std::array{high, low});
  }
  void put(Bytes part, std::uint32_t value, bool little_endian) {
    std::array<unsigned char, 4> bytes{};
    for (std::size_t i = 0; i < 4; ++i)
      bytes[little_endian ? i : 3 - i] = static_cast<unsigned char>(value >> 8 * i);
    put(part, bytes);
  }
  /// A sequence number: its high half first, whatever the byte order.
  void put_sequence_number(Bytes part, std::int64_t value, bool little_endian) {
    put(part.first(4), static_cast<std::uint32_t>(static_cast<std::uint64_t>(value) >> 32),
        little_endian);
    put(part.subspan(4), static_cast<std::uint32_t>(value), little_endian);
  }

  void cut_to(std::size_t size) { size_ = size; }
  [[nodiscard]] Bytes bytes() const {
    return (edited_ ? Bytes(storage().data(), original_.size()) : original_)
        .first(std::min(size_, original_.size()));
  }

 private:
  static std::array<unsigned char, kMost>& storage() {
    thread_local std::array<unsigned char, kMost> copy;
    return copy;
  }

  Bytes original_;
  bool edited_ = false;
  std::size_t size_ = kMost;
};

}  // namespace trammel::wire
