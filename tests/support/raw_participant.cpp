#include "tests/support/raw_participant.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <random>
#include <stdexcept>

namespace trammel::test {
namespace {

using Clock = std::chrono::steady_clock;

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in name{};
  name.sin_family = AF_INET;
  name.sin_port = htons(port);
  name.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return name;
}

std::uint32_t little(const PacketBytes& bytes, std::size_t at, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t i = size; i-- > 0;) value = value << 8 | bytes.at(at + i);
  return value;
}

}  // namespace

RawParticipant::RawParticipant(std::uint16_t port, std::uint32_t domain, unsigned seed)
    : port_(port), domain_(domain), socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in name = loopback(0);
  socklen_t size = sizeof name;
  if (socket_ < 0 || ::bind(socket_, reinterpret_cast<sockaddr*>(&name), size) != 0 ||
      ::getsockname(socket_, reinterpret_cast<sockaddr*>(&name), &size) != 0) {
    throw std::runtime_error("no UDP socket on the loopback");
  }
  own_port_ = ntohs(name.sin_port);
  std::mt19937 random(seed);
  for (unsigned char& byte : prefix_) byte = static_cast<unsigned char>(random());
  prefix_[0] = 1;
  prefix_[1] = 15;
  prefix_[2] = static_cast<unsigned char>(own_port_);
  prefix_[3] = static_cast<unsigned char>(own_port_ >> 8);
}

RawParticipant::~RawParticipant() { ::close(socket_); }

ParameterList RawParticipant::announcement() const {
  const std::string mark = "trammel.domain=" + std::to_string(domain_);
  PacketBytes user_data, lease;
  put32(user_data, static_cast<std::uint32_t>(mark.size()));
  user_data.insert(user_data.end(), mark.begin(), mark.end());
  put32(lease, 30);
  put32(lease, 0);
  ParameterList list;
  list.add(0x0015, {2, 3, 0, 0}).add(0x0016, {1, 15, 0, 0}).guid(0x0050, prefix_, 0x000001c1);
  list.locator(0x0032, own_port_)
      .locator(0x0031, own_port_)
      .add(0x0002, lease)
      .number(0x0058, 0x0c3f);
  list.add(0x002c, user_data);
  return list;
}

ParameterList RawParticipant::endpoint(std::uint32_t entity, const std::string& topic,
                                       const std::string& type) const {
  PacketBytes reliable;
  put32(reliable, 2);
  put32(reliable, 0);
  put32(reliable, 100'000'000);
  ParameterList list;
  list.guid(0x005a, prefix_, entity)
      .guid(0x0050, prefix_, 0x000001c1)
      .text(0x0005, topic)
      .text(0x0007, type);
  list.add(0x001a, reliable).locator(0x002f, own_port_);
  return list;
}

bool RawParticipant::learn(const PacketBytes& message) {
  return any_submessage(
      message, [&](unsigned char id, unsigned char flags, const PacketBytes& body) {
        constexpr std::size_t kHead = 20, kEncapsulation = 4;
        if (id != 0x15 || (flags & 4) == 0 || body.size() < kHead + kEncapsulation) return false;
        const PacketBytes announcer = {0x00, 0x01, 0x00, 0xc2};
        if (!std::equal(announcer.begin(), announcer.end(), body.begin() + 8)) return false;
        std::copy_n(message.begin() + 8, peer_.size(), peer_.begin());
        for (std::size_t at = kHead + kEncapsulation; at + 4 <= body.size();) {
          const std::uint32_t parameter = little(body, at, 2), length = little(body, at + 2, 2);
          if (parameter == 1) break;
          if (parameter == 0x31) data_port_ = static_cast<std::uint16_t>(little(body, at + 8, 4));
          at += 4 + length;
        }
        return true;
      });
}

bool RawParticipant::meet(std::chrono::milliseconds limit) {
  const auto deadline = Clock::now() + limit;
  const PacketBytes announced =
      Packet(prefix_).data({0, kAnnouncerId, 1, {}, announcement().payload()}).bytes();
  bool met = false;
  while (!met && Clock::now() < deadline) {
    send_to(port_, announced);
    met = wait_for([this](const PacketBytes& message) { return learn(message); },
                   std::chrono::milliseconds(100));
  }
  return met;
}

bool RawParticipant::become_writer(std::uint32_t entity, std::chrono::milliseconds limit) const {
  const PacketBytes list = endpoint(entity, "Topic", "Type").payload();
  send_to(port_, packet().data({kPublicationsReader, kPublicationsId, 1, {}, list}).bytes());
  PacketBytes own;
  put_entity(own, entity);
  return wait_for(
      [&](const PacketBytes& message) {
        return any_submessage(message,
                              [&](unsigned char id, unsigned char, const PacketBytes& body) {
                                return id == 0x06 && body.size() > 8 &&
                                       std::equal(own.begin(), own.end(), body.begin() + 4);
                              });
      },
      limit);
}

void RawParticipant::send(const PacketBytes& message) const {
  send_to(port_, message);
  if (data_port_ != 0) send_to(data_port_, message);
}
void RawParticipant::send_data(const PacketBytes& message) const { send_to(data_port_, message); }

void RawParticipant::send_to(std::uint16_t port, const PacketBytes& message) const {
  const sockaddr_in name = loopback(port);
  ::sendto(socket_, message.data(), message.size(), 0, reinterpret_cast<const sockaddr*>(&name),
           sizeof name);
}

std::optional<PacketBytes> RawParticipant::receive(std::chrono::milliseconds limit) const {
  pollfd in{socket_, POLLIN, 0};
  if (::poll(&in, 1, static_cast<int>(limit.count())) != 1) return std::nullopt;
  PacketBytes message(65536);
  const ssize_t size = ::recv(socket_, message.data(), message.size(), 0);
  if (size < 0) return std::nullopt;
  message.resize(static_cast<std::size_t>(size));
  return message;
}

bool RawParticipant::wait_for(const std::function<bool(const PacketBytes&)>& wanted,
                              std::chrono::milliseconds limit) const {
  const auto deadline = Clock::now() + limit;
  while (true) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now());
    if (left.count() <= 0) return false;
    const auto message = receive(left);
    if (message && wanted(*message)) return true;
  }
}

bool any_submessage(
    const PacketBytes& message,
    const std::function<bool(unsigned char, unsigned char, const PacketBytes&)>& found) {
  for (std::size_t at = 20; at + 4 <= message.size();) {
    std::size_t length = little(message, at + 2, 2);
    if (length == 0 || at + 4 + length > message.size()) length = message.size() - at - 4;
    const auto begin = message.begin() + static_cast<std::ptrdiff_t>(at + 4);
    const PacketBytes body(begin, begin + static_cast<std::ptrdiff_t>(length));
    if (found(message[at], message[at + 1], body)) return true;
    at += 4 + length;
  }
  return false;
}

}  // namespace trammel::test
