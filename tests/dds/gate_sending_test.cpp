// To whom a gate sends what the library would send to everybody.
#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/TransportReceiverInterface.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <fastdds/rtps/common/LocatorList.hpp>
#include <future>
#include <memory>
#include <vector>

#include "idl/repairs/domain_gate.h"
#include "idl/repairs/guard/rtps_bytes.h"
#include "idl/transport/participant.h"
#include "tests/support/rtps_packet.h"

namespace trammel::wire {
namespace {

using std::chrono::milliseconds;
using test::Packet;
using test::PacketBytes;
using test::ParameterList;
using test::Prefix;
namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::LocatorsIterator;
using eprosima::fastrtps::rtps::SenderResource;

constexpr Prefix kGateSelf = {1, 15, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11},
                 kGateResident = {1, 15, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9},
                 kGateNewcomer = {1, 15, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8};
constexpr std::uint32_t kGatePublications = 0x000003c2, kGateTheirReader = 0x000003c7;
constexpr std::uint16_t kGateOfResident = 2001, kGateOfNewcomer = 2002;  // UDP ports

/// Counts the datagrams instead of sending them.
class CountedSends final : public SenderResource {
 public:
  CountedSends() : SenderResource(LOCATOR_KIND_UDPv4) {
    send_lambda_ = [this](const unsigned char*, std::uint32_t, LocatorsIterator* first,
                          LocatorsIterator* last, const std::chrono::steady_clock::time_point&) {
      for (; *first != *last; ++*first) ports_.push_back((**first).port);
      return true;
    };
  }
  [[nodiscard]] int to(std::uint16_t port) const {
    return static_cast<int>(std::count(ports_.begin(), ports_.end(), std::uint32_t{port}));
  }

 private:
  std::vector<std::uint32_t> ports_;
};

/// The messages that the library would get.
class HeardMessages final : public rtps::TransportReceiverInterface {
 public:
  void OnDataReceived(const unsigned char*, const std::uint32_t, const Locator_t&,
                      const Locator_t&) override {
    ++messages;
  }
  int messages = 0;
};

PacketBytes announcement(const Prefix& of, std::uint16_t port) {
  PacketBytes lease;
  test::put32(lease, 10);
  test::put32(lease, 0);
  const ParameterList list = ParameterList()
                                 .guid(0x0050, of, 0x000001c1)
                                 .locator(0x0032, port)
                                 .locator(0x0031, port)
                                 .add(0x0002, lease);
  return Packet(of).data({0, 0x000100c2, 1, {}, list.payload()}).bytes();
}

class GateSending : public testing::Test {
 protected:
  explicit GateSending(const GateOptions& options = {})
      : gate_(dynamic_cast<rtps::ChainingTransport*>(
            with_domain_gate(std::make_shared<rtps::UDPv4TransportDescriptor>(), options)
                ->create_transport())) {
    hear(announcement(kGateResident, kGateOfResident));
    hear(announcement(kGateNewcomer, kGateOfNewcomer));
  }
  void hear(const PacketBytes& message) {
    gate_->receive(&heard_, message.data(), static_cast<std::uint32_t>(message.size()),
                   locator("127.0.0.1", 2000), locator("127.0.0.1", 3000));
  }
  /// To both of them.
  void send(const PacketBytes& message) {
    rtps::LocatorList to;
    for (const std::uint16_t port : {kGateOfResident, kGateOfNewcomer})
      to.push_back(locator("127.0.0.1", port));
    rtps::Locators first(to.begin()), last(to.end());
    gate_->send(&sends_, message.data(), static_cast<std::uint32_t>(message.size()), &first, &last,
                {});
  }
  static PacketBytes offer(std::uint32_t count) {
    return Packet(kGateSelf).heartbeat(kGateTheirReader, kGatePublications, 1, 900, count).bytes();
  }

  std::unique_ptr<rtps::ChainingTransport> gate_;
  HeardMessages heard_;
  CountedSends sends_;
};

TEST_F(GateSending, ANewcomerHearsEveryHeartbeatOfDiscoveryOfWhichTheOthersAreSparedMost) {
  constexpr int kOffers = 200;
  for (std::uint32_t i = 1; i <= kOffers; ++i) {
    hear(Packet(kGateNewcomer)
             .to(kGateSelf)
             .acknack(kGateTheirReader, kGatePublications, i, 1, i)
             .bytes());
    send(offer(i));
  }
  EXPECT_EQ(sends_.to(kGateOfNewcomer), kOffers) << "it asks for the next numbers at each";
  EXPECT_LT(sends_.to(kGateOfResident), kOffers);
}

TEST_F(GateSending, WhoHasConfirmedEverythingIsNoNewcomer) {
  constexpr int kOffers = 200;
  for (std::uint32_t i = 1; i <= kOffers; ++i) {
    hear(Packet(kGateNewcomer)
             .to(kGateSelf)
             .acknack(kGateTheirReader, kGatePublications, 901, 0, i)
             .bytes());
    send(offer(i));
  }
  EXPECT_LT(sends_.to(kGateOfNewcomer), kOffers);
  EXPECT_EQ(sends_.to(kGateOfResident), sends_.to(kGateOfNewcomer));
}

class GuardedGate : public GateSending {
 protected:
  static GateOptions guarded() {
    GateOptions options;
    options.dropped = std::make_shared<DropCounts>();
    return options;
  }
  GuardedGate() : GateSending(guarded()) {}
  /// The number of them that the library gets.
  int heard(const PacketBytes& message) {
    const int before = heard_.messages;
    hear(message);
    return heard_.messages - before;
  }
};

TEST_F(GuardedGate, WhatComesInOurOwnNameIsHeardOnlyWhereWeHaveSentIt) {
  const auto with_statistics = [](unsigned char told) {
    return Packet(kGateSelf)
        .heartbeat(kGateTheirReader, kGatePublications, 1, 900, 7)
        .submessage(kStatistics, 1, PacketBytes(56, told))
        .bytes();
  };
  send(with_statistics(1));
  EXPECT_EQ(heard(with_statistics(2)), 1) << "the transport below writes the statistics anew";
  EXPECT_EQ(heard(offer(7)), 1);
  EXPECT_EQ(heard(offer(8)), 0) << "a count that we have not said";
  EXPECT_EQ(
      heard(Packet(kGateSelf).heartbeat(kGateTheirReader, kGatePublications, 900, 900, 7).bytes()),
      0);
  send(Packet(kGateSelf)
           .to(kGateResident)
           .heartbeat(kGateTheirReader, kGatePublications, 1, 900, 9)
           .bytes());
  EXPECT_EQ(heard(Packet(kGateSelf)
                      .to(kGateResident)
                      .heartbeat(kGateTheirReader, kGatePublications, 1, 900, 9)
                      .bytes()),
            0)
      << "it was for somebody else";
  EXPECT_EQ(heard(Packet(kGateResident)
                      .to(kGateSelf)
                      .heartbeat(kGateTheirReader, kGatePublications, 1, 900, 9)
                      .bytes()),
            1);
}

TEST(Hearing, WhatComesBeforeTheLibraryHearsWaits) {
  const auto hearing = std::make_shared<Hearing>();
  GateOptions options;
  options.hearing = hearing;
  const std::unique_ptr<rtps::ChainingTransport> gate(dynamic_cast<rtps::ChainingTransport*>(
      with_domain_gate(std::make_shared<rtps::UDPv4TransportDescriptor>(), options)
          ->create_transport()));
  HeardMessages heard;
  const PacketBytes message = announcement(kGateResident, kGateOfResident);
  auto received = std::async(std::launch::async, [&] {
    gate->receive(&heard, message.data(), static_cast<std::uint32_t>(message.size()),
                  locator("127.0.0.1", 2000), locator("127.0.0.1", 3000));
  });
  EXPECT_EQ(received.wait_for(milliseconds(100)), std::future_status::timeout);
  hearing->begins();
  received.get();
  EXPECT_EQ(heard.messages, 1);
  gate->receive(&heard, message.data(), static_cast<std::uint32_t>(message.size()),
                locator("127.0.0.1", 2000), locator("127.0.0.1", 3000));
  EXPECT_EQ(heard.messages, 2);
}

}  // namespace
}  // namespace trammel::wire
