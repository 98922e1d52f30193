#include "tests/support/mutated_packets.h"

#include <algorithm>

namespace trammel::test {
namespace {

constexpr std::size_t kMostCollected = 400;
constexpr std::uint32_t kWriter = 0x00000103, kReader = 0x00000104;

}  // namespace

MutatedPackets::MutatedPackets(std::uint16_t port, std::uint32_t domain, unsigned seed)
    : participant_(port, domain, seed), random_(seed) {}

void MutatedPackets::add(PacketBytes packet) {
  if (packet.size() < 20 || corpus_.size() >= kMostCollected) return;
  // Turned round: from us, to its sender.
  std::copy(participant_.prefix().begin(), participant_.prefix().end(), packet.begin() + 8);
  const PacketBytes own(participant_.prefix().begin(), participant_.prefix().end());
  const auto to = std::search(packet.begin() + 20, packet.end(), own.begin(), own.end());
  if (to != packet.end()) std::copy(participant_.peer().begin(), participant_.peer().end(), to);
  corpus_.push_back(std::move(packet));
}

bool MutatedPackets::collect() {
  if (!participant_.meet(std::chrono::seconds(20))) return false;
  std::uint32_t entity = kWriter;
  std::int64_t number = 0;
  for (const char* topic : {"PredictError_2_Request", "ManageModels_2_Request", "SpokenContract"}) {
    const ParameterList list =
        participant_.endpoint(entity += 0x100, topic, std::string("trammel::wire::") + topic);
    const PacketBytes packet =
        participant_.packet()
            .data({kPublicationsReader, kPublicationsId, ++number, {}, list.payload()})
            .bytes();
    participant_.send(packet);
    corpus_.push_back(packet);
  }
  corpus_.push_back(Packet(participant_.prefix())
                        .data({0, kAnnouncerId, 1, {}, participant_.announcement().payload()})
                        .bytes());
  corpus_.push_back(participant_.packet().data({0, kWriter, 3, {}, PacketBytes(200, 1)}).bytes());
  corpus_.push_back(
      participant_.packet().heartbeat(0, kWriter, 1, 3, 1).gap(0, kWriter, 4, 9).bytes());
  corpus_.push_back(
      participant_.packet().fragments({0, kWriter, 5, 1, 1, 512, 2048, PacketBytes(512)}).bytes());
  corpus_.push_back(participant_.packet().nack_frag(kReader, kWriter, 2, 1, 1).bytes());
  corpus_.push_back(participant_.packet().acknack(kReader, kWriter, 2, 40, 2).bytes());
  static_cast<void>(participant_.wait_for(
      [this](const PacketBytes& message) {
        add(message);
        return corpus_.size() >= kMostCollected;
      },
      std::chrono::seconds(2)));
  return true;
}

PacketBytes MutatedPackets::mutated() {
  PacketBytes packet = corpus_[random_() % corpus_.size()];
  const auto any = [&] { return 20 + random_() % (packet.size() - 20); };
  constexpr unsigned char kNotable[] = {0x00, 0x01, 0x7f, 0x80, 0xff, 0x15, 0x16, 0x08, 0x07};
  for (std::size_t i = random_() % 5; i-- > 0 && packet.size() > 24;) {
    switch (random_() % 6) {
      case 0:  // a word of one kind of byte
        std::fill_n(packet.begin() + static_cast<std::ptrdiff_t>(any() & ~3u & (packet.size() - 5)),
                    4, kNotable[random_() % sizeof kNotable]);
        break;
      case 1:
        packet.resize(any());
        break;
      case 2: {  // a part of another one behind it
        const PacketBytes& other = corpus_[random_() % corpus_.size()];
        packet.insert(packet.end(), other.begin() + 20, other.end());
        if (packet.size() > 60'000) packet.resize(60'000);
        break;
      }
      case 3:
        packet[random_() % 20] = static_cast<unsigned char>(random_());
        break;
      default:
        packet[any()] = random_() % 2 == 0 ? kNotable[random_() % sizeof kNotable]
                                           : static_cast<unsigned char>(random_());
    }
  }
  return packet;
}

void MutatedPackets::wait_until_read() {
  participant_.send(participant_.packet()
                        .heartbeat(kPublicationsReader, kPublicationsId, 1, 3, 1'000'000 + ++pings_)
                        .bytes());
  static_cast<void>(participant_.wait_for(
      [](const PacketBytes& message) {
        return any_submessage(
            message, [](unsigned char id, unsigned char, const PacketBytes& body) {
              return id == 0x06 && body.size() > 8 && body[6] == 0x03 && body[7] == 0xc2;
            });
      },
      std::chrono::milliseconds(20)));
}

void MutatedPackets::send(std::size_t packets) {
  for (std::size_t i = 0; i < packets; ++i) {
    participant_.send(mutated());
    if (i % 500 == 499) wait_until_read();
  }
}

}  // namespace trammel::test
