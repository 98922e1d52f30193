#include "idl/repairs/domain_gate.h"

#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <string>
#include <vector>

namespace trammel::wire {
namespace {

using Bytes = std::vector<unsigned char>;

void add(Bytes& bytes, const Bytes& more) { bytes.insert(bytes.end(), more.begin(), more.end()); }

Bytes number(std::uint32_t value, std::size_t size, bool little_endian) {
  Bytes bytes;
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t shift = 8 * (little_endian ? i : size - 1 - i);
    bytes.push_back(static_cast<unsigned char>(value >> shift));
  }
  return bytes;
}

struct Announcement {
  bool little_endian = true;
  std::optional<std::uint32_t> domain;
  std::string user_data = {};
  bool inline_qos = false;
  bool last = true;  ///< its length is 0: to the end of the message
};

/// A participant that announces itself, behind a time stamp, as RTPS 2.3 lays it out.
Bytes message_of(const Announcement& a) {
  const auto n = [&](std::uint32_t value, std::size_t size) {
    return number(value, size, a.little_endian);
  };
  const auto parameter = [&](std::uint32_t id, const Bytes& value) {
    Bytes bytes = n(id, 2);
    add(bytes, n(static_cast<std::uint32_t>(value.size()), 2));
    add(bytes, value);
    return bytes;
  };
  Bytes data = n(0, 2);
  add(data, n(16, 2));
  add(data, {0, 1, 0, 0xc7, 0, 1, 0, 0xc2});
  add(data, Bytes(8, 0));
  if (a.inline_qos) {
    add(data, parameter(0x70, Bytes(16, 1)));
    add(data, n(1, 2));
    add(data, n(0, 2));
  }
  add(data, {0, static_cast<unsigned char>(a.little_endian ? 3 : 2), 0, 0});
  add(data, parameter(0x15, {2, 3, 0, 0}));
  if (a.domain) add(data, parameter(0x0f, n(*a.domain, 4)));
  if (!a.user_data.empty()) {
    Bytes value = n(static_cast<std::uint32_t>(a.user_data.size()), 4);
    add(value, Bytes(a.user_data.begin(), a.user_data.end()));
    while (value.size() % 4 != 0) value.push_back(0);
    add(data, parameter(0x2c, value));
  }
  add(data, n(1, 2));
  add(data, n(0, 2));

  const unsigned char endian = a.little_endian ? 1 : 0;
  Bytes message = {'R', 'T', 'P', 'S', 2, 3, 1, 15};
  add(message, Bytes(12, 0xab));
  add(message, {0x09, endian});
  add(message, n(8, 2));
  add(message, Bytes(8, 0));
  add(message, {0x15, static_cast<unsigned char>(endian | 4 | (a.inline_qos ? 2 : 0))});
  add(message, n(a.last ? 0 : static_cast<std::uint32_t>(data.size()), 2));
  add(message, data);
  return message;
}

TEST(DomainGate, AnAnnouncementOfAnotherDomainIsKnownByItsParameterOrItsUserData) {
  for (const bool little_endian : {true, false}) {
    for (const bool inline_qos : {true, false}) {
      for (const bool last : {true, false}) {
        const auto other = [&](std::optional<std::uint32_t> domain, const std::string& user_data) {
          return is_of_another_domain(
              message_of({little_endian, domain, user_data, inline_qos, last}), 5);
        };
        EXPECT_FALSE(other({}, "")) << "it does not say";
        EXPECT_FALSE(other(5, ""));
        EXPECT_TRUE(other(70, ""));
        EXPECT_FALSE(other({}, domain_mark(5)));
        EXPECT_TRUE(other({}, domain_mark(70)));
        EXPECT_TRUE(other({}, domain_mark(55)));
        EXPECT_TRUE(other(5, domain_mark(70)));
        EXPECT_FALSE(other({}, "somebody's own"));
        EXPECT_TRUE(is_announcement(message_of({little_endian, 5, "", inline_qos, last})));
      }
    }
  }
}

TEST(DomainGate, WhatIsNoAnnouncementPasses) {
  Bytes message = message_of({true, 70, domain_mark(70)});
  message[20 + 12 + 4 + 4 + 4 + 3] = 0xc3;  // of another writer
  EXPECT_FALSE(is_of_another_domain(message, 5));
  EXPECT_FALSE(is_announcement(message));
  EXPECT_FALSE(is_of_another_domain({}, 5));
}

TEST(DomainGate, ReadsNoByteBeyondAnyMessage) {
  std::mt19937 random(7);
  for (int seed = 0; seed < 50'000; ++seed) {
    Bytes message = message_of({seed % 2 == 0, 70, domain_mark(70), seed % 3 == 0, seed % 5 == 0});
    message.resize(random() % (message.size() + 1));
    for (int i = 0; i < 4 && !message.empty(); ++i) {
      message[random() % message.size()] = static_cast<unsigned char>(random());
    }
    message.shrink_to_fit();  // a sanitizer sees the byte behind it
    static_cast<void>(is_of_another_domain(message, 5));
  }
}

}  // namespace
}  // namespace trammel::wire
