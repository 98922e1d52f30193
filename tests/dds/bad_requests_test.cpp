// Every kind of bad request that another maker's client may send gets its code, changes nothing,
// and costs no memory.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "server/base/hash.h"
#include "server/base/memory.h"
#include "server/dds/dds_service.h"
#include "tests/dds/backend.h"
#include "tests/dds/raw_client.h"

namespace trammel {
namespace {

using test::Bytes;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
const std::vector<double> kJoints = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  double whole = 0, resident = 0;
  statm >> whole >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20);
}

/// Sends bad requests to one operation, counts them, and compares the codes of the answers.
template <typename Operation>
class Sender {
 public:
  using Request = typename Operation::Request::type;

  Sender(const DdsOptions& options, Request good)
      : client_(options.domain, options.port, std::string("bad-") + Operation::kName),
        good_(std::move(good)) {
    if (!client_.wait_until_matched()) throw std::runtime_error("no server");
  }

  [[nodiscard]] Request good() const { return good_; }
  void expect(const char* kind, wire::ResultCode code, Request request) {
    client_.fill_in(request.header(), next());
    send(kind, code, test::to_bytes<typename Operation::Request>(std::move(request)));
  }
  /// The good request, changed by `change`.
  void expect(const char* kind, wire::ResultCode code,
              const std::function<void(Request&)>& change) {
    Request request = good();
    client_.fill_in(request.header(), next());
    change(request);
    send(kind, code, test::to_bytes<typename Operation::Request>(std::move(request)));
  }
  /// The same, with a NUL in place of each `!`: the library's own writer would end the text there.
  void expect_nul(const char* kind, wire::ResultCode code,
                  const std::function<void(Request&)>& change) {
    Request request = good();
    client_.fill_in(request.header(), next());
    change(request);
    Bytes bytes = test::to_bytes<typename Operation::Request>(std::move(request));
    std::replace(bytes.begin(), bytes.end(), static_cast<unsigned char>('!'),
                 static_cast<unsigned char>(0));
    send(kind, code, std::move(bytes));
  }
  /// The bytes of the good request, changed by `change`.
  void expect_bytes(const char* kind, wire::ResultCode code,
                    const std::function<void(Bytes&)>& change) {
    Request request = good();
    client_.fill_in(request.header(), next());
    Bytes bytes = test::to_bytes<typename Operation::Request>(std::move(request));
    change(bytes);
    send(kind, code, std::move(bytes));
  }
  /// Checks the answers; the number of kinds.
  std::size_t check() {
    const auto replies = client_.wait_for_replies(expected_.size());
    EXPECT_EQ(replies.size(), expected_.size()) << Operation::kName;
    for (const auto& reply : replies) {
      const auto& header = reply.header();
      const auto& [kind, code] = expected_[header.related_request_id().sequence_number()];
      EXPECT_EQ(header.result(), code)
          << Operation::kName << ", " << kind << ": " << header.message();
      EXPECT_FALSE(header.message().empty()) << kind;
      EXPECT_FALSE(header.problems().empty()) << kind;
    }
    return expected_.size();
  }

 private:
  [[nodiscard]] std::int64_t next() const {
    return static_cast<std::int64_t>(expected_.size()) + 1;
  }
  void send(const char* kind, wire::ResultCode code, Bytes bytes) {
    expected_[next()] = {kind, code};
    client_.send(std::move(bytes));
    // One at a time: a client may not leave more than 64 unanswered.
    static_cast<void>(client_.wait_for_replies(expected_.size()));
  }

  test::RawClient<Operation> client_;
  const Request good_;
  std::map<std::int64_t, std::pair<std::string, wire::ResultCode>> expected_;  // by sequence number
};

/// What is wrong with any request.
template <typename Operation>
void send_what_is_always_wrong(Sender<Operation>& sender) {
  using Request = typename Operation::Request::type;
  using wire::RESULT_REFUSED, wire::RESULT_TOO_LARGE, wire::RESULT_MALFORMED,
      wire::RESULT_WRONG_CONTRACT;
  sender.expect("the contract before", RESULT_WRONG_CONTRACT,
                [](Request& r) { r.header().contract_version(1); });
  sender.expect("the contract after", RESULT_WRONG_CONTRACT,
                [](Request& r) { r.header().contract_version(3); });
  sender.expect("another writer", wire::RESULT_WRONG_IDENTITY,
                [](Request& r) { r.header().request_id().writer_guid()[5] ^= 1; });
  sender.expect("a trace with an escape", RESULT_REFUSED,
                [](Request& r) { r.header().trace_id("\x1b[2J"); });
  sender.expect("a long cell", RESULT_TOO_LARGE,
                [](Request& r) { r.about().cell(std::string(257, 'c')); });
  sender.expect("a long model", RESULT_TOO_LARGE,
                [](Request& r) { r.about().model(std::string(100'000, 'c')); });
  sender.expect("a cell with a line feed", RESULT_REFUSED,
                [](Request& r) { r.about().cell("cell\n7"); });
  sender.expect("a cell that is no UTF-8", RESULT_REFUSED,
                [](Request& r) { r.about().cell("cell-\xff"); });
  sender.expect("a tool with an escape", RESULT_REFUSED,
                [](Request& r) { r.about().tool("\x1b]0;x\a"); });
  sender.expect_nul("a payload with a NUL", RESULT_REFUSED,
                    [](Request& r) { r.about().payload("a!b"); });
  sender.expect_bytes("the last octets are missing", RESULT_MALFORMED,
                      [](Bytes& b) { b.resize(b.size() - 9); });
  sender.expect_bytes("only a header", RESULT_MALFORMED, [](Bytes& b) { b.resize(90); });
  sender.expect_bytes("more than there should be", RESULT_MALFORMED,
                      [](Bytes& b) { b.resize(b.size() + 8); });
  sender.expect_bytes("a hostile length", RESULT_MALFORMED, [](Bytes& b) {
    static const std::string kCell = "cell-7";  // the first text behind the header
    const auto cell = std::search(b.begin(), b.end(), kCell.begin(), kCell.end());
    std::fill(cell - 4, cell, static_cast<unsigned char>(0xee));
  });
}

class BadRequests : public testing::Test {
 protected:
  BadRequests() {
    give_large_blocks_back();  // as the daemon does
    if (!backend_.trainer->take_up()) throw std::runtime_error("cannot take up");
    for (const int version : {1, 2}) {
      const auto model = test::shifted_model(backend_.cell, version * 1e-4);
      if (!backend_.store->add_model("cell-7", model, 0, false, ""))
        throw std::runtime_error("cannot store");
    }
    const auto batch = backend_.trainer->submit("cell-7", "lt-07",
                                                test::small_batch_csv(*backend_.cell, {}), "first");
    if (!batch || !backend_.trainer->activate("cell-7", 1))
      throw std::runtime_error("cannot begin");
    if (const Status started = service_.start(); !started)
      throw std::runtime_error(started.error().message);
  }
  template <typename Operation>
  Sender<Operation> sender(typename Operation::Request::type good) const {
    good.about().cell("cell-7");
    return Sender<Operation>(options_, std::move(good));
  }
  /// The hash of everything that is stored.
  [[nodiscard]] std::string hash_of_store() const {
    std::string all;
    for (const char* name : {"trammel.db", "trammel.db-wal"}) {
      std::ifstream file(backend_.folder.file(name), std::ios::binary);
      all += std::string(std::istreambuf_iterator<char>(file), {}) + "|";
    }
    return sha256_hex(all);
  }
  static wire::CommandedJoints pose(const std::vector<double>& joints) {
    wire::CommandedJoints result;
    result.joints_rad(joints);
    result.approach().temperature_c(kNaN);
    result.approach().time_s(kNaN);
    return result;
  }
  static wire::Target target() {
    wire::Target result;
    result.kind(wire::TARGET_JOINTS);
    result.joints_rad(kJoints);
    result.pose().qw(1);
    result.approach().temperature_c(kNaN);
    result.approach().time_s(kNaN);
    return result;
  }

  std::size_t predictions();
  std::size_t corrections();
  std::size_t submissions();
  std::size_t trainings();
  std::size_t diagnoses();
  std::size_t readings();
  std::size_t changes();
  std::size_t releases();

  const DdsOptions options_ = test::test_dds_options();
  test::Backend backend_;
  DdsService service_{options_, *backend_.trainer, *backend_.store, backend_.registry};
};

std::size_t BadRequests::predictions() {
  wire::PredictErrorRequest good;
  good.poses({pose(kJoints), pose(kJoints)});
  auto send = sender<wire::PredictError>(good);
  send_what_is_always_wrong(send);
  using Request = wire::PredictErrorRequest;
  const auto expect = [&](const char* kind, wire::ResultCode code,
                          const std::function<void(Request&)>& change) {
    send.expect(kind, code, change);
  };
  expect("too many poses", wire::RESULT_TOO_LARGE,
         [](Request& r) { r.poses().resize(wire::MAX_TARGETS + 1); });
  expect("too many joints", wire::RESULT_TOO_LARGE,
         [](Request& r) { r.poses()[1].joints_rad().resize(17); });
  expect("too few joints", wire::RESULT_REFUSED,
         [](Request& r) { r.poses()[1].joints_rad().resize(5); });
  expect("no joints", wire::RESULT_REFUSED, [](Request& r) { r.poses()[1].joints_rad().clear(); });
  expect("a joint that is no number", wire::RESULT_REFUSED,
         [](Request& r) { r.poses()[0].joints_rad()[3] = kNaN; });
  expect("an infinite joint", wire::RESULT_REFUSED,
         [](Request& r) { r.poses()[0].joints_rad()[3] = -kInf; });
  expect("a joint beyond its limit", wire::RESULT_REFUSED,
         [](Request& r) { r.poses()[0].joints_rad()[2] = 1.5; });
  expect("a huge joint", wire::RESULT_REFUSED,
         [](Request& r) { r.poses()[0].joints_rad()[2] = 1e300; });
  expect("too many directions", wire::RESULT_TOO_LARGE,
         [](Request& r) { r.poses()[0].approach().directions().resize(17); });
  expect("too few directions", wire::RESULT_REFUSED,
         [](Request& r) { r.poses()[0].approach().directions({1}); });
  expect("a direction of two", wire::RESULT_REFUSED, [](Request& r) {
    r.poses()[0].approach().directions({0, 0, 2, 0, 0, 0});
  });
  expect("an infinite temperature", wire::RESULT_REFUSED,
         [](Request& r) { r.poses()[0].approach().temperature_c(kInf); });
  expect("an unknown cell", wire::RESULT_NOT_FOUND, [](Request& r) { r.about().cell("cell-9"); });
  expect("a cell without a model", wire::RESULT_NOT_FOUND,
         [](Request& r) { r.about().cell("cell-8"); });
  expect("no cell", wire::RESULT_NOT_FOUND, [](Request& r) { r.about().cell(""); });
  expect("an unknown tool", wire::RESULT_REFUSED, [](Request& r) { r.about().tool("gripper"); });
  expect("an unknown payload", wire::RESULT_REFUSED,
         [](Request& r) { r.about().payload("anvil"); });
  expect("a controller that compensates", wire::RESULT_REFUSED,
         [](Request& r) { r.about().controller_compensates(true); });
  expect("an unknown version", wire::RESULT_NOT_FOUND, [](Request& r) { r.about().model("@99"); });
  expect("a model that is not in force", wire::RESULT_CONFLICT,
         [](Request& r) { r.about().model("0123456789ab"); });
  return send.check();
}

std::size_t BadRequests::corrections() {
  wire::CorrectTargetRequest good;
  good.targets({target(), target()});
  auto send = sender<wire::CorrectTarget>(good);
  send_what_is_always_wrong(send);
  using Request = wire::CorrectTargetRequest;
  const auto expect = [&](const char* kind, wire::ResultCode code,
                          const std::function<void(wire::Target&)>& change) {
    send.expect(kind, code, [&](Request& r) { change(r.targets()[1]); });
  };
  const auto of_pose = [](wire::Target& t) -> wire::PoseMm& {
    t.kind(wire::TARGET_POSE_NEAR_JOINTS);
    return t.pose();
  };
  send.expect("too many targets", wire::RESULT_TOO_LARGE,
              [](Request& r) { r.targets().resize(wire::MAX_TARGETS + 1); });
  expect("an unknown kind", wire::RESULT_INVALID_ARGUMENT,
         [](wire::Target& t) { t.kind(static_cast<wire::TargetKind>(3)); });
  expect("a hostile kind", wire::RESULT_INVALID_ARGUMENT,
         [](wire::Target& t) { t.kind(static_cast<wire::TargetKind>(0x7fffffff)); });
  expect("a position that is no number", wire::RESULT_REFUSED,
         [&](wire::Target& t) { of_pose(t).y_mm(kNaN); });
  expect("an infinite position", wire::RESULT_REFUSED,
         [&](wire::Target& t) { of_pose(t).x_mm(kInf); });
  expect("no orientation", wire::RESULT_REFUSED, [&](wire::Target& t) { of_pose(t).qw(0); });
  expect("a long quaternion", wire::RESULT_REFUSED, [&](wire::Target& t) { of_pose(t).qx(1); });
  expect("a quaternion that is no number", wire::RESULT_REFUSED,
         [&](wire::Target& t) { of_pose(t).qz(kNaN); });
  expect("branch 8", wire::RESULT_REFUSED, [&](wire::Target& t) {
    t.kind(wire::TARGET_POSE_ON_BRANCH);
    t.conf(8);
  });
  expect("branch -1", wire::RESULT_REFUSED, [&](wire::Target& t) {
    t.kind(wire::TARGET_POSE_ON_BRANCH);
    t.conf(-1);
  });
  expect("too many joints", wire::RESULT_TOO_LARGE,
         [](wire::Target& t) { t.joints_rad().resize(200); });
  expect("too few joints", wire::RESULT_REFUSED, [](wire::Target& t) { t.joints_rad().resize(2); });
  expect("a joint that is no number", wire::RESULT_REFUSED,
         [](wire::Target& t) { t.joints_rad()[0] = kNaN; });
  expect("a direction of -2", wire::RESULT_REFUSED, [](wire::Target& t) {
    t.approach().directions({-2, 0, 0, 0, 0, 0});
  });
  expect("an infinite time", wire::RESULT_REFUSED,
         [](wire::Target& t) { t.approach().time_s(kInf); });
  return send.check();
}

std::size_t BadRequests::submissions() {
  wire::SubmitMeasurementsRequest good;
  good.batch_id("lt-08");
  good.csv("no batch");
  auto send = sender<wire::SubmitMeasurements>(good);
  send_what_is_always_wrong(send);
  using Request = wire::SubmitMeasurementsRequest;
  const std::string csv = test::small_batch_csv(*backend_.cell, {});
  const auto expect = [&](const char* kind, wire::ResultCode code,
                          const std::function<void(Request&)>& change) {
    send.expect(kind, code, change);
  };
  expect("no batch", wire::RESULT_REFUSED, [](Request&) {});
  expect("nothing", wire::RESULT_REFUSED, [](Request& r) { r.csv(""); });
  expect("a batch without an id", wire::RESULT_REFUSED, [&](Request& r) {
    r.csv(csv);
    r.batch_id("");
  });
  expect("an id that is taken", wire::RESULT_CONFLICT, [&](Request& r) {
    r.csv(csv + "\n");
    r.batch_id("lt-07");
  });
  expect("an id that is no UTF-8", wire::RESULT_REFUSED, [&](Request& r) {
    r.csv(csv);
    r.batch_id("lt-\xc3\x28");
  });
  expect("an id with a control character", wire::RESULT_REFUSED, [&](Request& r) {
    r.csv(csv);
    r.batch_id("lt-\x07");
  });
  expect("a long id", wire::RESULT_TOO_LARGE, [&](Request& r) {
    r.csv(csv);
    r.batch_id(std::string(300, 'b'));
  });
  expect("a change with a space", wire::RESULT_REFUSED, [](Request& r) { r.change_id("a b"); });
  send.expect_nul("a batch with a NUL", wire::RESULT_REFUSED,
                  [&](Request& r) { r.csv(csv + "!!!"); });
  expect("a batch of another robot", wire::RESULT_REFUSED,
         [](Request& r) { r.csv("q1_deg,q2_deg,x_mm,y_mm,z_mm\n1,2,3,4,5\n"); });
  expect("a column that is missing", wire::RESULT_REFUSED,
         [](Request& r) { r.csv("q1_deg,x_mm\n1,2\n"); });
  expect("numbers that are none", wire::RESULT_REFUSED, [&](Request& r) {
    r.csv(csv.substr(0, csv.find('\n') + 1) + "nan,nan,nan,nan,nan,nan,1,2,3\n");
  });
  expect("a batch of the largest size", wire::RESULT_TOO_LARGE,
         [](Request& r) { r.csv(std::string(30u << 20, 'x')); });
  expect("a batch over the largest size", wire::RESULT_TOO_LARGE,
         [](Request& r) { r.csv(std::string(wire::kMaxText + 1, 'x')); });
  expect("a batch that no topic has room for", wire::RESULT_TOO_LARGE,
         [](Request& r) { r.csv(std::string(40u << 20, 'x')); });
  expect("a column that is missing, behind it", wire::RESULT_REFUSED,
         [](Request& r) { r.csv("q1_deg,x_mm\n1,2\n"); });
  return send.check();
}

std::size_t BadRequests::trainings() {
  wire::TrainRequest good;
  good.change().expected_version(-1);
  good.batch_ids({"lt-99"});
  auto send = sender<wire::Train>(good);
  send_what_is_always_wrong(send);
  using Request = wire::TrainRequest;
  const auto expect = [&](const char* kind, wire::ResultCode code,
                          const std::function<void(Request&)>& change) {
    send.expect(kind, code, change);
  };
  expect("an unknown batch", wire::RESULT_NOT_FOUND, [](Request&) {});
  expect("an unknown kind", wire::RESULT_INVALID_ARGUMENT,
         [](Request& r) { r.kind(static_cast<wire::TrainKind>(9)); });
  expect("too many batches", wire::RESULT_TOO_LARGE,
         [](Request& r) { r.batch_ids(std::vector<std::string>(1001, "lt-07")); });
  expect("a batch twice", wire::RESULT_REFUSED, [](Request& r) {
    r.batch_ids({"lt-07", "lt-07"});
  });
  expect("a level that does not exist", wire::RESULT_INVALID_ARGUMENT, [](Request& r) {
    r.batch_ids({"lt-07"});
    r.level("M9");
  });
  expect("a bias that does not exist", wire::RESULT_REFUSED, [](Request& r) {
    r.batch_ids({"lt-07"});
    r.bias("magic");
  });
  expect("a level of a hundred kilobytes", wire::RESULT_TOO_LARGE,
         [](Request& r) { r.level(std::string(100'000, 'M')); });
  expect("a rule", wire::RESULT_UNSUPPORTED, [](Request& r) { r.batch_rule("the last three"); });
  expect("a prior", wire::RESULT_UNSUPPORTED, [](Request& r) { r.prior("fleet"); });
  expect("a diagnosis that is done", wire::RESULT_UNSUPPORTED, [](Request& r) { r.diagnosis(1); });
  expect("another version than in force", wire::RESULT_CONFLICT, [](Request& r) {
    r.batch_ids({"lt-07"});
    r.change().expected_version(2);
  });
  expect("a version that there cannot be", wire::RESULT_INVALID_ARGUMENT,
         [](Request& r) { r.change().expected_version(-2); });
  expect("a batch beside stored ones", wire::RESULT_INVALID_ARGUMENT,
         [](Request& r) { r.csv("q1_deg"); });
  expect("a diagnosis of two batches", wire::RESULT_INVALID_ARGUMENT, [](Request& r) {
    r.kind(wire::TRAIN_DIAGNOSED);
    r.batch_ids({"lt-07", "lt-08"});
  });
  expect("a diagnosis with a level", wire::RESULT_INVALID_ARGUMENT, [](Request& r) {
    r.kind(wire::TRAIN_DIAGNOSED);
    r.level("M1");
  });
  return send.check();
}

std::size_t BadRequests::diagnoses() {
  wire::DiagnoseRequest good;
  good.batch_id("lt-99");
  auto send = sender<wire::Diagnose>(good);
  send_what_is_always_wrong(send);
  using Request = wire::DiagnoseRequest;
  send.expect("an unknown batch", wire::RESULT_NOT_FOUND, [](Request&) {});
  send.expect("a batch and its name", wire::RESULT_INVALID_ARGUMENT,
              [](Request& r) { r.csv("q1_deg"); });
  send.expect("no batch", wire::RESULT_REFUSED, [](Request& r) {
    r.batch_id("");
    r.csv("{}");
  });
  wire::CheckHealthRequest check;
  check.batch_id("lt-99");
  check.tolerance_mm(std::numeric_limits<double>::quiet_NaN());
  auto checks = sender<wire::CheckHealth>(check);
  send_what_is_always_wrong(checks);
  checks.expect("an unknown batch", wire::RESULT_NOT_FOUND, [](wire::CheckHealthRequest&) {});
  checks.expect("a tolerance below 0", wire::RESULT_INVALID_ARGUMENT,
                [](wire::CheckHealthRequest& r) { r.tolerance_mm(-0.1); });
  return send.check() + checks.check();
}

std::size_t BadRequests::readings() {
  auto send = sender<wire::ReadModels>({});
  send_what_is_always_wrong(send);
  using Request = wire::ReadModelsRequest;
  const auto expect = [&](
                          const char* kind, wire::ResultCode code, wire::ReadKind what,
                          const std::function<void(Request&)>& change = [](Request&) {}) {
    send.expect(kind, code, [&](Request& r) {
      r.what(what);
      change(r);
    });
  };
  expect("an unknown kind", wire::RESULT_INVALID_ARGUMENT, static_cast<wire::ReadKind>(12));
  expect("the work by an unknown version", wire::RESULT_NOT_FOUND, wire::READ_REPLAY,
         [](Request& r) { r.version(99); });
  expect("an unknown version", wire::RESULT_NOT_FOUND, wire::READ_MODEL,
         [](Request& r) { r.version(99); });
  expect("version -1", wire::RESULT_NOT_FOUND, wire::READ_MODEL, [](Request& r) { r.version(-1); });
  expect("an unknown batch", wire::RESULT_NOT_FOUND, wire::READ_BATCH,
         [](Request& r) { r.batch_id("nobody"); });
  expect("a batch without a name", wire::RESULT_NOT_FOUND, wire::READ_BATCH);
  expect("an unknown job", wire::RESULT_NOT_FOUND, wire::READ_JOB, [](Request& r) { r.job(99); });
  expect("findings of an unknown job", wire::RESULT_NOT_FOUND, wire::READ_FINDINGS,
         [](Request& r) { r.job(99); });
  expect("findings of a training", wire::RESULT_NOT_FOUND, wire::READ_FINDINGS,
         [](Request& r) { r.job(1); });
  expect("the models of no cell", wire::RESULT_NOT_FOUND, wire::READ_MODELS,
         [](Request& r) { r.about().cell(""); });
  return send.check();
}

std::size_t BadRequests::changes() {
  wire::ManageModelsRequest good;
  good.change().expected_version(-1);
  good.version(99);
  auto send = sender<wire::ManageModels>(good);
  send_what_is_always_wrong(send);
  using Request = wire::ManageModelsRequest;
  const auto expect = [&](const char* kind, wire::ResultCode code,
                          const std::function<void(Request&)>& change) {
    send.expect(kind, code, change);
  };
  expect("an unknown version", wire::RESULT_NOT_FOUND, [](Request&) {});
  expect("an unknown action", wire::RESULT_INVALID_ARGUMENT,
         [](Request& r) { r.action(static_cast<wire::ManageAction>(5)); });
  expect("a backup", wire::RESULT_UNSUPPORTED, [](Request& r) { r.action(wire::MANAGE_BACKUP); });
  expect("force", wire::RESULT_UNSUPPORTED, [](Request& r) {
    r.action(wire::MANAGE_ROLLBACK);
    r.force(true);
  });
  expect("another version than in force", wire::RESULT_CONFLICT, [](Request& r) {
    r.version(2);
    r.change().expected_version(2);
  });
  expect("a rollback to nothing", wire::RESULT_NOT_FOUND,
         [](Request& r) { r.action(wire::MANAGE_ROLLBACK); });
  expect("to cancel an unknown job", wire::RESULT_NOT_FOUND, [](Request& r) {
    r.action(wire::MANAGE_CANCEL_JOB);
    r.job(99);
  });
  const auto import = [&](const char* kind, wire::ResultCode code, const std::string& text) {
    expect(kind, code, [&](Request& r) {
      r.action(wire::MANAGE_IMPORT);
      r.model_text(text);
    });
  };
  for (const char* text : {"", "{}", "no model", "[]", "{\"trammel_model\":1}"})
    import("a model that is none", wire::RESULT_REFUSED, text);
  import("brackets", wire::RESULT_TOO_LARGE, std::string(2'000'000, '['));
  import("brackets in a model", wire::RESULT_TOO_LARGE,
         R"({"trammel_model":1,"content":)" + std::string(30'000'000, '['));
  expect("a model of another cell", wire::RESULT_REFUSED, [](Request& r) {
    r.about().cell("cell-8");
    r.action(wire::MANAGE_IMPORT);
    r.model_text("{}");
  });
  expect("a long reason", wire::RESULT_TOO_LARGE,
         [](Request& r) { r.reason(std::string(5000, 'r')); });
  return send.check();
}

std::size_t BadRequests::releases() {
  wire::ReleaseBatchesRequest good;
  good.change().expected_version(-1);
  good.batch_ids({"lt-99"});
  auto send = sender<wire::ReleaseBatches>(good);
  send_what_is_always_wrong(send);
  using Request = wire::ReleaseBatchesRequest;
  const auto expect = [&](const char* kind, wire::ResultCode code,
                          const std::function<void(Request&)>& change) {
    send.expect(kind, code, change);
  };
  expect("an unknown batch", wire::RESULT_NOT_FOUND, [](Request&) {});
  expect("an unknown action", wire::RESULT_INVALID_ARGUMENT,
         [](Request& r) { r.action(static_cast<wire::ReleaseAction>(3)); });
  expect("to discard an unknown batch", wire::RESULT_NOT_FOUND,
         [](Request& r) { r.action(wire::RELEASE_DISCARD); });
  expect("nothing", wire::RESULT_INVALID_ARGUMENT, [](Request& r) { r.batch_ids({}); });
  expect("two at once", wire::RESULT_INVALID_ARGUMENT, [](Request& r) {
    r.batch_ids({"lt-07", "lt-08"});
  });
  expect("to train from nothing", wire::RESULT_REFUSED, [](Request& r) {
    r.action(wire::RELEASE_AND_TRAIN);
    r.batch_ids({});
  });
  expect("to train from an unknown one", wire::RESULT_NOT_FOUND,
         [](Request& r) { r.action(wire::RELEASE_AND_TRAIN); });
  return send.check();
}

TEST_F(BadRequests, EachGetsItsCodeAndChangesNothing) {
  predictions();  // once before, so that everything that is made once has been made
  const std::string before = hash_of_store();
  const double before_mb = resident_mb();
  const std::size_t kinds = predictions() + corrections() + submissions() + trainings() +
                            diagnoses() + readings() + changes() + releases();
  EXPECT_GE(kinds, 130U);
  EXPECT_EQ(hash_of_store(), before);
  EXPECT_EQ(backend_.registry.in_force("cell-7")->version, 1);
  EXPECT_LE(resident_mb(), 2 * before_mb) << kinds << " kinds; " << before_mb << " MB before";
}

}  // namespace
}  // namespace trammel
