// A service under load: what each client gets beside clients that flood, do not listen, or are too
// many.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clients/session/session.h"
#include "server/dds/dds_service.h"
#include "tests/dds/backend.h"
#include "tests/dds/raw_client.h"

namespace trammel {
namespace {

using Corrector = test::RawClient<wire::CorrectTarget>;
const std::vector<double> kLoadJoints = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};

wire::CorrectTargetRequest corrections(std::size_t targets) {
  wire::CorrectTargetRequest request;
  request.about().cell("cell-7");
  wire::Target target;
  target.kind(wire::TARGET_JOINTS);
  target.joints_rad(kLoadJoints);
  target.approach().temperature_c(std::nan(""));
  target.approach().time_s(std::nan(""));
  request.targets(std::vector<wire::Target>(targets, target));
  return request;
}

class LoadTest : public testing::Test {
 protected:
  explicit LoadTest(DdsOptions options = test::test_dds_options()) : options_(std::move(options)) {
    if (!backend_.trainer->take_up()) throw std::runtime_error("cannot take up");
    backend_.serve(1);
  }
  void start() {
    if (const Status started = service().start(); !started)
      throw std::runtime_error(started.error().message);
  }
  DdsService& service() {
    if (!service_) {
      service_ = std::make_unique<DdsService>(options_, *backend_.trainer, *backend_.store,
                                              backend_.registry);
    }
    return *service_;
  }
  std::unique_ptr<Corrector> corrector(const std::string& partition) const {
    return std::make_unique<Corrector>(options_.domain, options_.port, partition);
  }

  /// The server's status once it has counted so many answers.
  [[nodiscard]] client::ServerStatus status_after(std::uint64_t requests) const {
    const auto session =
        client::Session::open({options_.domain, {options_.port}, std::chrono::seconds(20)});
    client::ServerStatus status;
    for (int look = 0; status.requests < requests && look < 20000; ++look) {
      static_cast<void>((*session)->models("cell-7"));  // its status comes every second
      status = (*session)->servers().value().front();
    }
    return status;
  }

  DdsOptions options_;
  test::Backend backend_;
  std::unique_ptr<DdsService> service_;
};

/// The number of replies with each code.
template <typename Reply>
std::map<wire::ResultCode, std::size_t> codes(const std::vector<Reply>& replies) {
  std::map<wire::ResultCode, std::size_t> counted;
  for (const Reply& reply : replies) ++counted[reply.header().result()];
  return counted;
}

TEST_F(LoadTest, EightClientsThatAskForMoreThanCanBeDoneAreAllAnsweredOrToldSo) {
  constexpr std::size_t kSent = 150;
  start();
  std::vector<std::unique_ptr<Corrector>> clients;
  for (int k = 0; k < 8; ++k) {
    clients.push_back(corrector("raw-" + std::to_string(k)));
    ASSERT_TRUE(clients.back()->wait_until_matched());
  }
  for (std::size_t i = 0; i < kSent; ++i) {
    for (auto& client : clients) client->send(corrections(500), static_cast<std::int64_t>(i));
  }
  std::size_t busy = 0, least = kSent, most = 0;
  for (auto& client : clients) {
    const auto replies = client->wait_for_replies(kSent);
    auto counted = codes(replies);
    EXPECT_EQ(counted[wire::RESULT_OK] + counted[wire::RESULT_BUSY], kSent);
    least = std::min(least, counted[wire::RESULT_OK]);
    most = std::max(most, counted[wire::RESULT_OK]);
    busy += counted[wire::RESULT_BUSY];
    std::set<std::int64_t> numbers;
    for (const auto& reply : replies)
      numbers.insert(reply.header().related_request_id().sequence_number());
    EXPECT_EQ(numbers.size(), kSent) << "one was answered twice, another not at all";
  }
  EXPECT_GT(busy, 0U);
  const client::ServerStatus told = status_after(clients.size() * kSent);
  EXPECT_EQ(told.shed, busy);
  EXPECT_EQ(told.lost, 0U);
  EXPECT_GE(3 * least, most) << "one client was served, another not";
}

TEST_F(LoadTest, AnHonestClientAmongSixteenFloodersTakesTurnsWithThem) {
  start();
  std::vector<std::unique_ptr<Corrector>> flooders;
  for (int k = 0; k < 16; ++k) {
    flooders.push_back(corrector("flooder-" + std::to_string(k)));
    ASSERT_TRUE(flooders.back()->wait_until_matched());
  }
  auto honest = corrector("honest");
  ASSERT_TRUE(honest->wait_until_matched());
  constexpr std::size_t kEach = 60;
  wire::CorrectTargetRequest patient = corrections(200);
  patient.header().deadline_ms(600000);
  for (std::size_t i = 0; i < kEach; ++i) {
    for (auto& flooder : flooders) flooder->send(patient, static_cast<std::int64_t>(i));
  }
  for (std::size_t i = 0; i < 5; ++i) {
    honest->send(corrections(1), static_cast<std::int64_t>(i));
    ASSERT_EQ(honest->wait_for_replies(i + 1).size(), i + 1);
  }
  std::size_t answered = 0;
  for (auto& flooder : flooders) answered += flooder->replies();
  EXPECT_EQ(codes(honest->wait_for_replies(5))[wire::RESULT_OK], 5U);
  EXPECT_LT(answered, flooders.size() * kEach / 2) << "it waited behind the requests of the others";
}

TEST_F(LoadTest, RepliesThatNobodyReadsCostNobodyElseAnything) {
  start();
  auto hostile = corrector("hostile");
  auto honest = corrector("honest");
  ASSERT_TRUE(hostile->wait_until_matched());
  ASSERT_TRUE(honest->wait_until_matched());
  constexpr std::int64_t kInvented = 100;
  for (std::int64_t i = 0; i < kInvented; ++i)
    hostile->send_for(fmt::format("nobody-{}", i), corrections(1), i);
  for (std::int64_t i = 0; i < 20; ++i) {
    honest->send(corrections(1), i);
    ASSERT_EQ(honest->wait_for_replies(static_cast<std::size_t>(i) + 1).size(),
              static_cast<std::size_t>(i) + 1);
  }
  hostile->send(corrections(1), kInvented);
  EXPECT_EQ(hostile->wait_for_replies(1).size(), 1U) << "its own channel has not been taken away";
}

TEST_F(LoadTest, ARequestThatNamesAnotherClientsPartitionIsNotAnsweredThere) {
  start();
  auto victim = corrector("victim");
  auto thief = corrector("thief");
  ASSERT_TRUE(victim->wait_until_matched());
  ASSERT_TRUE(thief->wait_until_matched());
  thief->send_for("victim", corrections(3), 1);
  thief->send(corrections(2), 2);
  ASSERT_EQ(thief->wait_for_replies(1).size(), 1U);
  victim->send(corrections(1), 1);
  const auto replies = victim->wait_for_replies(1);
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].corrections().size(), 1U);
}

TEST_F(LoadTest, ARepeatOfARequestThatWaitsIsAnsweredFromTheSameWork) {
  start();
  auto client = corrector("raw-1");
  ASSERT_TRUE(client->wait_until_matched());
  const auto patient = [](std::size_t targets) {  // however slow the processor is
    auto request = corrections(targets);
    request.header().deadline_ms(300000);
    return request;
  };
  for (std::int64_t i = 0; i < 5; ++i) client->send(patient(200), i);
  for (int i = 0; i < 3; ++i) client->send(patient(10), 5);
  const auto replies = client->wait_for_replies(8);
  ASSERT_EQ(replies.size(), 8U);
  std::map<std::int64_t, std::size_t> times;
  for (const auto& reply : replies) {
    EXPECT_EQ(reply.header().result(), wire::RESULT_OK) << reply.header().message();
    ++times[reply.header().related_request_id().sequence_number()];
  }
  EXPECT_EQ(times[5], 3U);
}

TEST_F(LoadTest, AnIdThatWasGivenToSomethingElseIsAConflictAndGetsNobodyElsesTargets) {
  start();
  auto client = corrector("raw-1");
  ASSERT_TRUE(client->wait_until_matched());
  client->send(corrections(3), 1);
  ASSERT_EQ(client->wait_for_replies(1).size(), 1U);
  client->send(corrections(2), 1);
  ASSERT_EQ(client->wait_for_replies(2).size(), 2U);
  client->send(corrections(3), 1);
  const auto replies = client->wait_for_replies(3);
  ASSERT_EQ(replies.size(), 3U);
  EXPECT_EQ(replies[1].header().result(), wire::RESULT_CONFLICT);
  EXPECT_EQ(replies[1].corrections().size(), 0U);
  EXPECT_EQ(replies[2].header().result(), wire::RESULT_OK) << "a repeat";
  EXPECT_EQ(replies[2].corrections(), replies[0].corrections());
}

TEST_F(LoadTest, SlowChangesOfOneCellHoldUpNeitherReadingNorAnotherCell) {
  start();
  using Manager = test::RawClient<wire::ManageModels>;
  Manager slow(options_.domain, options_.port, "slow");
  Manager other(options_.domain, options_.port, "other");
  ASSERT_TRUE(slow.wait_until_matched());
  ASSERT_TRUE(other.wait_until_matched());
  wire::ManageModelsRequest import;
  import.about().cell("cell-7");
  import.action(wire::MANAGE_IMPORT);
  std::string text = "[";
  for (int i = 0; i < 500000; ++i) text += "0.125,";
  import.model_text(text + "1]");
  import.change().expected_version(-1);
  constexpr std::size_t kImports = 12;
  test::RawClient<wire::ReadModels> reader(options_.domain, options_.port, "reader");
  ASSERT_TRUE(reader.wait_until_matched());
  for (std::size_t i = 0; i < kImports; ++i) slow.send(import, static_cast<std::int64_t>(i));
  wire::ReadModelsRequest list;
  list.about().cell("cell-7");
  list.what(wire::READ_MODELS);
  reader.send(list, 1);
  wire::ManageModelsRequest rollback;
  rollback.about().cell("cell-8");
  rollback.action(wire::MANAGE_ROLLBACK);
  rollback.change().expected_version(-1);
  other.send(rollback, 1);
  ASSERT_EQ(reader.wait_for_replies(1).size(), 1U);
  ASSERT_EQ(other.wait_for_replies(1).size(), 1U);
  EXPECT_LT(slow.replies(), kImports) << "they waited behind the imports";
  EXPECT_EQ(slow.wait_for_replies(kImports).size(), kImports);
}

class NarrowTest : public LoadTest {
 protected:
  static DdsOptions one_at_a_time() {
    DdsOptions options = test::test_dds_options();
    options.client_requests = 1;
    return options;
  }
  NarrowTest() : LoadTest(one_at_a_time()) {}
};

TEST_F(NarrowTest, ASessionThatIsToldToTryAgainLaterDoesSo) {
  start();
  const auto session =
      client::Session::open({options_.domain, {options_.port}, std::chrono::seconds(20)});
  ASSERT_TRUE(session) << session.error().message;
  client::CallContext cell_7;
  cell_7.cell = "cell-7";
  std::vector<std::future<std::size_t>> callers;
  for (int k = 0; k < 8; ++k) {
    callers.push_back(std::async(std::launch::async, [&] {
      std::size_t answered = 0;
      for (int i = 0; i < 10; ++i) {
        exchange::AskedTarget target;
        target.seed_rad = kLoadJoints;
        target.joint_target = true;
        const auto answer =
            (*session)->correct_targets(cell_7, std::vector<exchange::AskedTarget>(200, target));
        EXPECT_TRUE(answer) << answer.error().message;
        answered += answer ? 1 : 0;
      }
      return answered;
    }));
  }
  std::size_t answered = 0;
  for (auto& caller : callers) answered += caller.get();
  EXPECT_EQ(answered, 80U);
}

class CrowdTest : public LoadTest {
 protected:
  static DdsOptions two_channels() {
    DdsOptions options = test::test_dds_options();
    options.max_clients = 2;
    return options;
  }
  CrowdTest() : LoadTest(two_channels()) {}
};

TEST_F(CrowdTest, AClientThatWaitsToBeMatchedIsServedThoughThereAreTooMany) {
  start();
  std::vector<std::unique_ptr<Corrector>> clients;
  for (const char* name : {"raw-1", "raw-2", "raw-3", "raw-4"}) {
    clients.push_back(corrector(name));
    ASSERT_TRUE(clients.back()->wait_until_matched()) << name << " waits for ever";
    clients.back()->send(corrections(1), 1);
    EXPECT_EQ(clients.back()->wait_for_replies(1).size(), 1U) << name;
  }
  for (auto& client : clients) {
    ASSERT_TRUE(client->wait_until_matched()) << "lost its channel for ever";
    client->send(corrections(1), 2);
    EXPECT_EQ(client->wait_for_replies(2).size(), 2U);
  }
}

}  // namespace
}  // namespace trammel
