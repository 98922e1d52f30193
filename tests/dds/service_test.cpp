#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <future>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include "clients/session/session.h"
#include "server/dds/dds_service.h"
#include "tests/dds/backend.h"
#include "tests/dds/raw_client.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

constexpr std::chrono::seconds kLimit{30};
const std::vector<double> kJoints = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
client::CallContext context_of(const std::string& cell) {
  client::CallContext context;
  context.cell = cell;
  return context;
}
const client::CallContext kCell7 = context_of("cell-7");

exchange::AskedTarget joint_target() {
  exchange::AskedTarget target;
  target.seed_rad = kJoints;
  target.joint_target = true;
  return target;
}

std::vector<wire::CommandedJoints> poses(std::size_t count) {
  wire::CommandedJoints pose;
  pose.joints_rad(kJoints);
  return std::vector<wire::CommandedJoints>(count, pose);
}

std::unique_ptr<client::Session> open_session(
    const DdsOptions& options, std::chrono::milliseconds timeout = std::chrono::seconds(10)) {
  auto session = client::Session::open({options.domain, {options.port}, timeout});
  if (!session) throw std::runtime_error(session.error().message);
  return std::move(*session);
}

/// A service on a backend of its own, wired as the daemon does it.
class Server {
 public:
  explicit Server(DdsOptions options) : options_(std::move(options)) {
    backend_.trainer->set_listeners(
        [this](const JobProgress& progress) { service_.publish_progress(progress); },
        [this](const ServedModel& model, bool in_force) {
          if (in_force) service_.publish_model(model.cell);
        });
    if (const auto taken = backend_.trainer->take_up(); !taken)
      throw std::runtime_error(taken.error().message);
  }
  void start() {
    const Status started = service_.start();
    if (!started) throw std::runtime_error(started.error().message);
  }
  void start_trainer() { ASSERT_TRUE(backend_.trainer->start()); }
  void stop() { service_.stop(); }
  DdsService& service() { return service_; }
  test::Backend& backend() { return backend_; }
  const DdsOptions& options() const { return options_; }

 private:
  const DdsOptions options_;
  test::Backend backend_;
  DdsService service_{options_, *backend_.trainer, *backend_.store, backend_.registry};
};

class ServiceTest : public testing::Test {
 protected:
  Server server_{test::test_dds_options()};
};

TEST_F(ServiceTest, AnswersAClientThatCameLater) {
  server_.backend().serve(4);
  server_.start();
  const auto session = open_session(server_.options());
  const auto begin = std::chrono::steady_clock::now();
  const auto answer = session->predict_error(kCell7, {kJoints, kJoints});
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(4)) << "was asked twice";
  ASSERT_EQ(answer->items.size(), 2u);
  EXPECT_NEAR(answer->items[0].error_mm[0], 0.4, 1e-9);
  EXPECT_EQ(answer->model.version, 4);
}

TEST_F(ServiceTest, AnswersAClientThatCameFirst) {
  server_.backend().serve(4);
  const auto session = open_session(server_.options());
  auto answer =
      std::async(std::launch::async, [&] { return session->predict_error(kCell7, {kJoints}); });
  server_.start();
  const auto got = answer.get();
  EXPECT_TRUE(got) << got.error().message;
}

TEST_F(ServiceTest, AnswersAgainAfterARestart) {
  server_.backend().serve(4);
  const auto session = open_session(server_.options());
  for (int round = 0; round < 3; ++round) {
    server_.start();
    const auto answer = session->predict_error(kCell7, {kJoints});
    EXPECT_TRUE(answer) << answer.error().message;
    server_.stop();
  }
}

TEST_F(ServiceTest, NobodyThereIsUnreachable) {
  const auto session = open_session(server_.options(), std::chrono::milliseconds(300));
  const auto answer = session->predict_error(kCell7, {kJoints});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::kUnreachable);
  EXPECT_EQ(answer.error().field, "server");
  EXPECT_EQ(answer.error().text, fmt::format("300 ms, looking at 127.0.0.1:{} in domain {}",
                                             server_.options().port, server_.options().domain));
  EXPECT_FALSE(session->servers());
}

TEST_F(ServiceTest, WhatTheServerRefusesArrivesWithItsCode) {
  server_.backend().serve(1);
  server_.start();
  const auto session = open_session(server_.options());
  EXPECT_EQ(session->predict_error(context_of("cell-9"), {kJoints}).error().code,
            ErrorCode::kNotFound);
  client::CallContext compensating = kCell7;
  compensating.controller_compensates = true;
  EXPECT_EQ(session->predict_error(compensating, {kJoints}).error().code, ErrorCode::kRefused);
  EXPECT_EQ(session->predict_error(kCell7, {{1, 2}}).error().code, ErrorCode::kRefused);
  EXPECT_EQ(session->submit_measurements("cell-7", "lt-07", "no csv").error().code,
            ErrorCode::kRefused);
  EXPECT_EQ(session->activate("cell-7", 9).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(
      session->submit_measurements("cell-7", "lt-07", std::string(33u << 20, 'x')).error().code,
      ErrorCode::kTooLarge);
}

TEST_F(ServiceTest, ATextThatANulWouldCutShortIsNotSent) {
  server_.start();
  const auto session = open_session(server_.options());
  const std::string torn =
      test::small_batch_csv(*server_.backend().cell, {}) + std::string(100, '\0');
  const auto submitted = session->submit_measurements("cell-7", "lt-07", torn);
  ASSERT_FALSE(submitted) << "the rows before the NUL were taken for the batch";
  EXPECT_EQ(submitted.error().code, ErrorCode::kRefused);
  EXPECT_EQ(refusal_of(submitted), Refusal("batch lt-07", 42));
  EXPECT_FALSE(session->import_model("cell-7", torn));
}

TEST_F(ServiceTest, AModelWhoseTextsNoReplyCanCarryAnswersAndIsListed) {
  server_.start();
  test::Backend& backend = server_.backend();
  CompensatedModel::Parts parts = test::shifted_model(backend.cell, 1e-4).parts();
  parts.provenance.level = std::string(wire::MAX_SPELLING + 1, 'L');
  parts.provenance.batch_id = "\x1b[31m" + std::string(3 * wire::MAX_SENTENCE, 'B');
  parts.provenance.batch_hash = std::string("h\0h", 3) + std::string(wire::MAX_ID, 'h');
  parts.provenance.trained_at = std::numeric_limits<std::int64_t>::min();
  parts.provenance.measured_at = std::numeric_limits<std::int64_t>::max();
  const CompensatedModel model = CompensatedModel::make(parts).value();
  const int version = backend.store->add_model("cell-7", model, 0, true, "").value();
  backend.registry.publish(
      std::make_shared<const ServedModel>(ServedModel{"cell-7", version, model}));
  const auto session = open_session(server_.options());
  const auto answer = session->predict_error(kCell7, {kJoints});
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer->model.level, std::string(wire::MAX_SPELLING, 'L'));
  EXPECT_TRUE(answer->model.batch_id.starts_with("\\u001b[31mBBB"))
      << answer->model.batch_id.substr(0, 30);
  const auto listed = session->models("cell-7");
  EXPECT_TRUE(listed) << listed.error().message;
}

TEST_F(ServiceTest, LongCallsGoInParts) {
  server_.backend().serve(2);
  server_.start();
  const auto session = open_session(server_.options());
  const std::vector<std::vector<double>> joints(2 * wire::MAX_TARGETS + 1, kJoints);
  const auto answer = session->predict_error(kCell7, joints);
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer->items.size(), joints.size());

  const std::vector<exchange::AskedTarget> targets(wire::kTargetsPerRequest + 3, joint_target());
  const auto corrected = session->correct_targets(kCell7, targets);
  ASSERT_TRUE(corrected) << corrected.error().message;
  ASSERT_EQ(corrected->items.size(), targets.size());
  EXPECT_EQ(corrected->items.back().status, "ok");
  EXPECT_NEAR(corrected->items.back().error_before_mm, 0.2, 1e-6);
}

TEST_F(ServiceTest, TheLargestRequestAndItsReplyFit) {
  server_.backend().serve(2);
  server_.start();
  test::RawClient<wire::CorrectTarget> client(server_.options().domain, server_.options().port,
                                              "raw-1");
  ASSERT_TRUE(client.wait_for_server());
  wire::CorrectTargetRequest request;
  request.about().cell("cell-7");
  wire::Target target;
  target.kind(wire::TARGET_JOINTS);
  target.joints_rad(kJoints);
  request.targets(std::vector<wire::Target>(wire::MAX_TARGETS, target));
  client.send(request, 1);
  auto replies = client.wait_for_replies(1);
  ASSERT_EQ(replies.size(), 1u);
  EXPECT_EQ(replies[0].corrections().size(), wire::MAX_TARGETS);
  request.targets().push_back(target);
  client.send(request, 2);
  replies = client.wait_for_replies(2);
  ASSERT_EQ(replies.size(), 2u);
  EXPECT_EQ(replies[1].header().result(), wire::RESULT_TOO_LARGE);
}

TEST_F(ServiceTest, ARequestThatIsSentOnceMoreIsNotComputedAgain) {
  server_.backend().serve(1);
  server_.start();
  test::RawClient<wire::PredictError> client(server_.options().domain, server_.options().port,
                                             "raw-1");
  ASSERT_TRUE(client.wait_for_server());
  wire::PredictErrorRequest request;
  request.about().cell("cell-7");
  request.poses(poses(1));
  client.send(request, 1);
  ASSERT_EQ(client.wait_for_replies(1).size(), 1U);
  server_.backend().serve(2);
  client.send(request, 1);
  client.send(request, 2);
  const auto replies = client.wait_for_replies(3);
  ASSERT_EQ(replies.size(), 3U);
  for (const auto& reply : replies) {
    const auto number = reply.header().related_request_id().sequence_number();
    EXPECT_EQ(reply.model().version(), number == 1 ? 1 : 2);
  }
}

TEST_F(ServiceTest, ClientsThatUseTheSameRequestIdsGetTheirOwnAnswers) {
  server_.backend().serve(1);
  server_.start();
  const std::vector<std::string> names = {"raw-1", "raw-2"};
  std::vector<std::unique_ptr<test::RawClient<wire::PredictError>>> clients;
  for (std::size_t k = 0; k < names.size(); ++k) {
    clients.push_back(std::make_unique<test::RawClient<wire::PredictError>>(
        server_.options().domain, server_.options().port, names[k]));
    ASSERT_TRUE(clients[k]->wait_for_server());
    wire::PredictErrorRequest request;
    request.about().cell("cell-7");
    request.poses(poses(k + 1));
    clients[k]->send(request, 1);
    const auto replies = clients[k]->wait_for_replies(1);
    ASSERT_EQ(replies.size(), 1U);
    EXPECT_EQ(replies[0].predictions().size(), k + 1);
  }
}

TEST_F(ServiceTest, AProgramIsCorrectedByOneModelThoughAnotherIsPutInForceMeanwhile) {
  server_.backend().serve(1);
  server_.start();
  const auto session = open_session(server_.options());
  int calls = 0;
  const auto swap_at_the_third_part = [&](double) {
    if (++calls == 3) server_.backend().serve(2);
  };
  const std::vector<exchange::AskedTarget> targets(3000, joint_target());
  const auto corrected = session->correct_targets(kCell7, targets, swap_at_the_third_part);
  ASSERT_TRUE(corrected) << corrected.error().message;
  EXPECT_EQ(corrected->model.version, 2);
  ASSERT_EQ(corrected->items.size(), targets.size());
  for (const exchange::CorrectedTarget& item : corrected->items)
    EXPECT_NEAR(item.error_before_mm, 0.2, 1e-6);
}

/// Where an answer was lost: what is missing, whether the two still see each other, and what the
/// service counts.
template <typename Client>
std::string lost_answers(Client& client, DdsService& service, std::multiset<std::int64_t> missing) {
  for (const auto& reply : client.wait_for_replies(0)) {
    const auto found = missing.find(reply.header().related_request_id().sequence_number());
    if (found != missing.end()) missing.erase(found);
  }
  const ServiceFigures figures = service.figures();
  std::string text = client.is_matched() ? "matched" : "not matched any more";
  text += "; unheard " + std::to_string(figures.unheard) + ", misdirected " +
          std::to_string(figures.misdirected) + ", lost " + std::to_string(figures.lost) +
          ", unreadable " + std::to_string(figures.unreadable);
  for (const auto& [reason, count] : figures.dropped_packets)
    if (count > 0) text += ", dropped for " + reason + " " + std::to_string(count);
  text += "; without an answer:";
  for (const std::int64_t number : missing) text += " " + std::to_string(number);
  return text;
}

TEST_F(ServiceTest, EveryRequestHasExactlyOneAnswer) {
  server_.backend().serve(1);
  server_.start();
  test::RawClient<wire::PredictError> client(server_.options().domain, server_.options().port,
                                             "raw-1");
  test::RawClient<wire::PredictError> other(server_.options().domain, server_.options().port,
                                            "raw-2");
  ASSERT_TRUE(client.wait_for_server());
  ASSERT_TRUE(other.wait_for_server());
  wire::PredictErrorRequest request;
  request.about().cell("cell-7");
  request.poses(poses(1));
  constexpr int kRounds = 10;
  constexpr int kOutstanding = wire::kReplyDepth - 1;
  std::multiset<std::int64_t> expected;
  for (int round = 0; round < kRounds; ++round) {
    for (int i = 0; i < kOutstanding; ++i) {
      const int number = round * kOutstanding + i;
      request.header().server(i % 2 == 0 ? "" : "server-a");
      client.send(request, number);
      other.send(request, number);
      expected.insert(number);
    }
    request.header().server("somebody-else");
    client.send(request, -1);  // not for this server
    for (auto* one : {&client, &other})
      ASSERT_EQ(one->wait_for_replies(expected.size()).size(), expected.size())
          << lost_answers(*one, server_.service(), expected);
  }
  for (auto* one : {&client, &other}) {
    std::multiset<std::int64_t> ids;
    for (const auto& reply : one->wait_for_replies(expected.size())) {
      EXPECT_EQ(reply.header().result(), wire::RESULT_OK) << reply.header().message();
      ids.insert(reply.header().related_request_id().sequence_number());
    }
    EXPECT_EQ(ids, expected);
  }
}

TEST_F(ServiceTest, TheLogTellsWhatWasChangedOrRefusedUnderTheClientsTrace) {
  std::mutex mutex;
  std::condition_variable told;
  std::vector<CallReport> reports;  // guarded by mutex
  server_.service().set_call_listener([&](const CallReport& report) {
    {
      const std::lock_guard lock(mutex);
      reports.push_back(report);
    }
    told.notify_all();
  });
  server_.backend().serve(1);
  server_.start();
  test::RawClient<wire::ManageModels> client(server_.options().domain, server_.options().port,
                                             "raw-1");
  ASSERT_TRUE(client.wait_until_matched());
  wire::ManageModelsRequest request;
  request.header().trace_id("shift-3/program-17");
  request.about().cell("cell-7");
  request.change().expected_version(-1);
  request.version(9);
  client.send(request, 1);
  std::unique_lock lock(mutex);
  ASSERT_TRUE(told.wait_for(lock, kLimit, [&] { return !reports.empty(); }));
  EXPECT_EQ(reports[0].operation, "ManageModels");
  EXPECT_EQ(reports[0].trace, "shift-3/program-17");
  EXPECT_EQ(reports[0].cell, "cell-7");
  EXPECT_TRUE(reports[0].changes);
  EXPECT_NE(reports[0].refused.find("version 9"), std::string::npos) << reports[0].refused;
}

TEST_F(ServiceTest, ARequestInAnotherClientsNameIsRefusedAndNeverAnsweredToThatClient) {
  server_.backend().serve(1);
  server_.start();
  using Client = test::RawClient<wire::PredictError>;
  Client victim(server_.options().domain, server_.options().port, "victim");
  Client thief(server_.options().domain, server_.options().port, "thief");
  ASSERT_TRUE(victim.wait_until_matched());
  ASSERT_TRUE(thief.wait_until_matched());
  wire::PredictErrorRequest forged;
  victim.fill_in(forged.header(), 1);
  forged.about().cell("cell-7");
  forged.poses(poses(3));
  thief.send(test::to_bytes<wire::PredictError::Request>(
      forged));  // name, number and partition of the victim
  forged.header().reply_partition("thief");
  thief.send(test::to_bytes<wire::PredictError::Request>(forged));  // name and number only
  const auto told = thief.wait_for_replies(1);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].header().result(), wire::RESULT_WRONG_IDENTITY);
  wire::PredictErrorRequest own;
  own.about().cell("cell-7");
  own.poses(poses(1));
  victim.send(own, 1);
  const auto answered = victim.wait_for_replies(1);
  ASSERT_EQ(answered.size(), 1U);
  EXPECT_EQ(answered[0].header().result(), wire::RESULT_OK) << answered[0].header().message();
  EXPECT_EQ(answered[0].predictions().size(), 1U)
      << "the thief's poses came as the victim's answer";
  const auto session = open_session(server_.options());
  std::uint64_t misdirected = 0;
  for (int look = 0; misdirected == 0 && look < 20000; ++look) {
    static_cast<void>(session->models("cell-7"));  // its status comes every second
    misdirected = session->servers().value().front().misdirected;
  }
  EXPECT_EQ(misdirected, 1U);
}

TEST_F(ServiceTest, AServerOfAnotherContractIsNamedByTheClientThatFindsNoOther) {
  for (const std::uint32_t contract : {1U, 3U}) {
    const DdsOptions options = server_.options();
    auto other = wire::make_participant(
                     {"another server", options.domain, options.address, options.port, {}})
                     .value();
    wire::dds::DataWriter* writer =
        other->create_publisher(wire::publisher_qos({}))
            ->create_datawriter(wire::make_contract_topic(*other).value(),
                                wire::service_status_writer_qos());
    wire::SpokenContract status;
    status.server("elder");
    status.contract_version(contract);
    status.program_version("9.9");
    ASSERT_TRUE(writer->write(&status));
    const auto session = open_session(options, std::chrono::milliseconds(3000));
    const auto servers = session->servers();
    ASSERT_FALSE(servers);
    EXPECT_EQ(refusal_of(servers),
              Refusal("", {}, "contract_version").beyond(contract, wire::CONTRACT_VERSION));
    EXPECT_NE(servers.error().message.find("elder"), std::string::npos);
    EXPECT_EQ(servers.error().next, contract == 1 ? "update the server" : "update this program");
    EXPECT_EQ(session->predict_error(kCell7, {kJoints}).error().field, "contract_version");
    other.reset();
  }
}

TEST_F(ServiceTest, HostileSamplesDoNotStopAReader) {
  server_.backend().serve(1);
  server_.start();
  test::RawClient<wire::PredictError> client(server_.options().domain, server_.options().port,
                                             "raw-1");
  ASSERT_TRUE(client.wait_for_server());
  wire::PredictErrorRequest request;
  request.about().cell("cell-7");
  request.poses(poses(1));
  client.fill_in(request.header(), 0);
  request.header().reply_partition("*");
  const test::Bytes reaches_all = test::to_bytes<wire::PredictError::Request>(request);
  request.header().reply_partition("raw-1");
  const test::Bytes good = test::to_bytes<wire::PredictError::Request>(request);
  test::Bytes encapsulation = good;
  encapsulation[1] = 0x77;
  for (int i = 1; i <= 10; ++i) {
    client.send(encapsulation);
    client.send(test::Bytes(good.begin(), good.end() - 8));
    client.send(test::Bytes(4, 0xff));
    client.send(reaches_all);
    client.send(test::Bytes(wire::kMaxComputeSample + 1000, 1));
    client.send(request, i);
  }
  // The truncated one has a header that can be read: it is answered.
  const auto replies = client.wait_for_replies(20);
  ASSERT_EQ(replies.size(), 20u);
  std::map<wire::ResultCode, int> counts;
  for (const auto& reply : replies) ++counts[reply.header().result()];
  EXPECT_EQ(counts,
            (std::map<wire::ResultCode, int>{{wire::RESULT_OK, 10}, {wire::RESULT_MALFORMED, 10}}));
}

TEST_F(ServiceTest, EveryAnswerComesWholeFromTheModelItNames) {
  constexpr int kSwaps = 25;
  std::map<int, std::string> hashes;  // by version
  hashes[1] = server_.backend().serve(1)->model.provenance().hash;
  std::vector<std::shared_ptr<const ServedModel>> models;
  for (int version = 2; version <= kSwaps; ++version) {
    models.push_back(std::make_shared<const ServedModel>(ServedModel{
        "cell-7", version, test::shifted_model(server_.backend().cell, version * 1e-4)}));
    hashes[version] = models.back()->model.provenance().hash;
  }
  server_.start();

  std::mutex mutex;
  std::condition_variable answered;
  int newest[2] = {0, 0};  // guarded by mutex: version that each client saw last
  std::atomic<bool> enough = false;
  const auto load = [&](int index) {
    const auto session = open_session(server_.options());
    int wrong = 0;
    while (!enough) {
      const auto answer =
          session->predict_error(kCell7, std::vector<std::vector<double>>(50, kJoints));
      if (!answer) {
        ADD_FAILURE() << answer.error().message;
        enough = true;
      } else {
        const int version = answer->model.version;
        if (answer->model.hash != hashes.at(version)) ++wrong;
        for (const auto& item : answer->items)
          wrong += std::abs(item.error_mm[0] - 0.1 * version) > 1e-9 ? 1 : 0;
        const std::lock_guard lock(mutex);
        newest[index] = version;
      }
      answered.notify_all();
    }
    return wrong;
  };
  auto first = std::async(std::launch::async, load, 0);
  auto second = std::async(std::launch::async, load, 1);
  const auto wait_until_served = [&](int version) {
    std::unique_lock lock(mutex);
    return answered.wait_for(
        lock, kLimit, [&] { return enough || (newest[0] >= version && newest[1] >= version); });
  };
  EXPECT_TRUE(wait_until_served(1));
  for (const auto& model : models) {
    server_.backend().registry.publish(model);
    server_.service().publish_model("cell-7");
    EXPECT_TRUE(wait_until_served(model->version)) << model->version;
  }
  enough = true;
  EXPECT_EQ(first.get(), 0);
  EXPECT_EQ(second.get(), 0);
}

TEST_F(ServiceTest, TwoSessionsAndTheirThreadsDoNotMixTheirAnswers) {
  server_.backend().serve(3);
  server_.start();
  const auto one = open_session(server_.options());
  const auto two = open_session(server_.options());
  const auto load = [](client::Session& session, std::size_t count) {
    for (int i = 0; i < 50; ++i) {
      const auto answer =
          session.predict_error(kCell7, std::vector<std::vector<double>>(count, kJoints));
      if (!answer || answer->items.size() != count) return false;
    }
    return true;
  };
  std::vector<std::future<bool>> done;
  for (const std::size_t count : {1, 2, 3}) {
    done.push_back(std::async(std::launch::async, load, std::ref(*one), count));
    done.push_back(std::async(std::launch::async, load, std::ref(*two), count + 10));
  }
  for (auto& each : done) EXPECT_TRUE(each.get());
}

TEST_F(ServiceTest, ALongCorrectionDoesNotHoldUpAPrediction) {
  server_.backend().serve(1);
  server_.start();
  const auto session = open_session(server_.options(), kLimit);
  ASSERT_TRUE(session->predict_error(kCell7, {kJoints}));
  std::atomic<bool> corrected = false;
  auto long_call = std::async(std::launch::async, [&] {
    const std::vector<exchange::AskedTarget> targets(30000, joint_target());
    const bool good = session->correct_targets(kCell7, targets).has_value();
    corrected = true;
    return good;
  });
  int meanwhile = 0;
  while (!corrected && meanwhile < 20) {
    const auto told = session->predict_error(kCell7, {kJoints});
    ASSERT_TRUE(told) << "prediction " << meanwhile << ": " << told.error().message;
    ++meanwhile;
  }
  EXPECT_EQ(meanwhile, 20);
  EXPECT_TRUE(long_call.get());
}

TEST_F(ServiceTest, ASubmittedBatchIsTrainedWatchedAndPutInForce) {
  server_.start();
  server_.start_trainer();
  const auto session = open_session(server_.options());
  const auto job = session->submit_measurements("cell-7", "lt-07",
                                                test::small_batch_csv(*server_.backend().cell, {}));
  ASSERT_TRUE(job) << job.error().message;
  int heard = 0;
  const auto status =
      session->wait_for_job(*job, kLimit, [&](const client::JobStatus&) { ++heard; });
  ASSERT_TRUE(status) << status.error().message;
  EXPECT_EQ(status->stage, "done") << status->what;
  EXPECT_GT(heard, 0);
  const auto in_force = session->model_status();
  ASSERT_TRUE(in_force);
  ASSERT_EQ(in_force->size(), 1u);
  EXPECT_EQ(in_force->front().version, status->model_version);
  EXPECT_EQ(in_force->front().batch_id, "lt-07");
  EXPECT_EQ(in_force->front().batch_hash.size(), 64u);
  const auto models = session->models("cell-7");
  ASSERT_TRUE(models);
  ASSERT_EQ(models->size(), 1u);
  EXPECT_EQ(models->front().batch_hash, in_force->front().batch_hash);
  EXPECT_EQ(status->verdict, "in_force");
  EXPECT_LT(status->after_mm.value_or(1e9), status->before_mm.value_or(0));
  const auto again = session->train("cell-7", {"lt-07"}, "", "");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_NE(*again, *job);
  EXPECT_TRUE(session->wait_for_job(*again, kLimit, nullptr));
  const auto text = session->export_model("cell-7", 1);
  ASSERT_TRUE(text);
  EXPECT_EQ(session->import_model("cell-7", *text).value_or(0), 1);
  EXPECT_EQ(session->activate("cell-7", 1).value_or(0), 1);
  EXPECT_EQ(session->wait_for_job(99, kLimit, nullptr).error().code, ErrorCode::kNotFound);
}

TEST_F(ServiceTest, ASentBatchIsDiagnosedAndThePageComesAlong) {
  server_.start();
  server_.start_trainer();
  const auto session = open_session(server_.options());
  const auto job =
      session->diagnose("cell-7", "", test::small_batch_csv(*server_.backend().cell, {}), false);
  ASSERT_TRUE(job) << job.error().message;
  const auto status = session->wait_for_job(*job, kLimit, nullptr);
  ASSERT_TRUE(status) << status.error().message;
  EXPECT_EQ(status->stage, "done") << status->what;
  const auto found = session->diagnosis("cell-7", *job, true);
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_NE(found->findings_json.find("\"verdict\""), std::string::npos);
  EXPECT_NE(found->page_html.find("</html>"), std::string::npos);
  EXPECT_EQ(session->diagnosis("cell-8", *job, false).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(session->diagnose("cell-7", "lt-99", "", false).error().code, ErrorCode::kNotFound);
}

TEST_F(ServiceTest, ABatchInQuarantineIsShownAndReleased) {
  server_.start();
  const auto session = open_session(server_.options());
  ASSERT_TRUE(session->submit_measurements("cell-7", "lt-07",
                                           test::small_batch_csv(*server_.backend().cell, {})));
  ASSERT_TRUE(server_.backend().store->set_quarantine("cell-7", "lt-07", "another tool"));
  const auto apart = session->quarantine("");
  ASSERT_TRUE(apart) << apart.error().message;
  ASSERT_EQ(apart->size(), 1u);
  EXPECT_EQ(apart->front().batch, "lt-07");
  EXPECT_EQ(apart->front().reason, "another tool");
  EXPECT_EQ(session->train("cell-7", {"lt-07"}, "", "").error().code, ErrorCode::kRefused);
  ASSERT_TRUE(session->release("cell-7", "lt-07"));
  EXPECT_TRUE(session->train("cell-7", {"lt-07"}, "", ""));
}

TEST_F(ServiceTest, TellsWhoServesWhat) {
  server_.backend().serve(6);
  server_.start();
  const auto session = open_session(server_.options());
  const auto servers = session->servers();
  ASSERT_TRUE(servers) << servers.error().message;
  ASSERT_EQ(servers->size(), 1u);
  EXPECT_EQ(servers->front().server_id, "server-a");
  EXPECT_EQ(servers->front().state, "serving");
  EXPECT_EQ(servers->front().cells, (std::vector<std::string>{"cell-7", "cell-8"}));
  const auto models = session->model_status();
  ASSERT_TRUE(models) << models.error().message;
  ASSERT_EQ(models->size(), 1u);
  EXPECT_EQ(models->front().version, 6);
}

TEST_F(ServiceTest, AnotherServerAnswersWhenOneHasGone) {
  DdsOptions options = server_.options();
  options.server_id = "server-b";
  options.port = static_cast<std::uint16_t>(options.port + 2);
  Server other(options);
  server_.backend().serve(1);
  other.backend().serve(2);
  server_.start();
  other.start();
  auto session =
      client::Session::open({options.domain, {server_.options().port, options.port}, kLimit});
  ASSERT_TRUE(session) << session.error().message;
  EXPECT_EQ((*session)->servers().value().size(), 2u);
  EXPECT_TRUE((*session)->predict_error(kCell7, {kJoints}));
  server_.stop();
  const auto answer = (*session)->predict_error(kCell7, {kJoints});
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer->model.version, 2);
}

TEST_F(ServiceTest, ASecondServerOnThePortIsRefused) {
  server_.start();
  Server second(server_.options());
  const Status started = second.service().start();
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, ErrorCode::kConflict);
}

TEST_F(ServiceTest, AnAddressThatIsNotThisHostsIsRefused) {
  DdsOptions options = server_.options();
  options.address = "192.0.2.1";
  Server elsewhere(options);
  EXPECT_FALSE(elsewhere.service().start());
  options.address = "here";
  Server nowhere(options);
  EXPECT_EQ(nowhere.service().start().error().code, ErrorCode::kUsage);
}

TEST_F(ServiceTest, NamesThatDoNotFitTheWireAreRefused) {
  DdsOptions options = server_.options();
  for (const std::string& id : {std::string(), std::string("a b"), std::string(65, 'a')}) {
    options.server_id = id;
    Server server(options);
    EXPECT_FALSE(server.service().start()) << id;
  }
}

}  // namespace
}  // namespace trammel
