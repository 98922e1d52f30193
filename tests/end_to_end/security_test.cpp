// Who may do what: a daemon and clients with certificates and permissions as deploy/security/keys
// makes them.
#include <gtest/gtest.h>
#include <signal.h>

#include <ctime>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "idl/topics.h"
#include "server/base/text_file.h"
#include "tests/dds/raw_client.h"
#include "tests/support/daemon.h"
#include "tests/support/http_client.h"
#include "tests/support/raw_participant.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;
constexpr seconds kSecurityLimit{30};
constexpr std::chrono::milliseconds kInVain{
    2500};  // a participant that is refused tries again once a second

/// Authorities and participants, made once for all tests of this process.
class Keys {
 public:
  Keys() { keys({"init", folder_.path().string()}); }

  /// The folder of a participant, made at its first use.
  std::string of(const std::string& role, const std::string& name, const std::string& days = "30") {
    const std::string path = folder_.file("participants/" + name);
    if (!fs::exists(path)) keys({"issue", folder_.path().string(), role, name, "--days", days});
    return path;
  }
  std::string until(const std::string& time, const std::string& role, const std::string& name) {
    keys({"issue", folder_.path().string(), role, name, "--until", time});
    return folder_.file("participants/" + name);
  }
  void revoke(const std::string& name) { keys({"revoke", folder_.path().string(), name}); }
  [[nodiscard]] std::string authority() const { return folder_.file("authority"); }

  static void keys(std::vector<std::string> words) {
    words.insert(words.begin(), TRAMMEL_SOURCE_DIR "/deploy/security/keys");
    const auto done = test::run(words);
    ASSERT_EQ(done.exit_code, 0) << done.err;
  }

 private:
  test::TemporaryFolder folder_;
};

Keys& keys() {
  static Keys all;
  return all;
}

class SecurityTest : public testing::Test {
 protected:
  void SetUp() override {
    const std::string text = test::read_file(daemon_.config_path());
    ASSERT_TRUE(write_text_file(daemon_.config_path(),
                                text + "dds: {security: " + keys().of("server", "line-3") +
                                    "}\nhttp: {port: " + std::to_string(http()) + "}\n"));
  }
  [[nodiscard]] std::uint16_t http() const {
    return static_cast<std::uint16_t>(daemon_.port() + 1);
  }
  [[nodiscard]] Result<std::unique_ptr<client::Session>> session(const std::string& folder) {
    client::SessionOptions options = daemon_.session_options();
    options.security = folder;
    return client::Session::open(options);
  }
  /// Nobody answers such a client.
  void expect_nobody(const std::string& folder) {
    client::SessionOptions options = daemon_.session_options();
    options.security = folder;
    options.timeout = kInVain;
    const auto opened = client::Session::open(options);
    ASSERT_TRUE(opened) << opened.error().message;
    const auto servers = (*opened)->servers();
    ASSERT_FALSE(servers);
    EXPECT_EQ(servers.error().code, ErrorCode::kUnreachable);
    // A server that refuses is as silent as none: who shows a certificate is told that this may be
    // why.
    EXPECT_EQ(servers.error().next.find("certificates") != std::string::npos, !folder.empty())
        << servers.error().next;
  }
  [[nodiscard]] int refused_handshakes() const {
    const std::string text = test::http_get(http(), "/metrics").body;
    const std::string name = "\ntrammel_participants_refused_total ";
    return std::stoi(text.substr(text.find(name) + name.size()));
  }

  test::Daemon daemon_;
};

/// The context of calls.
client::CallContext cell_7() {
  client::CallContext context;
  context.cell = "cell-7";
  return context;
}

using Calls = std::map<std::string, std::function<Error(client::Session&)>>;

/// The outcome of a call; an error of no code where it was done.
template <typename Value>
Error said(const Result<Value>& result) {
  return result ? Error{} : result.error();
}

const Calls& calls() {
  static const Calls all = {
      {"PredictError",
       [](client::Session& s) {
         return said(s.predict_error(cell_7(), {{0, 0, 0, 0, 0, 0}}));
       }},
      {"CorrectTarget",
       [](client::Session& s) {
         return said(s.correct_targets(cell_7(), {exchange::AskedTarget{}}));
       }},
      {"ReadModels", [](client::Session& s) { return said(s.models("cell-7")); }},
      {"SubmitMeasurements",
       [](client::Session& s) { return said(s.submit_measurements("cell-7", "", "no csv")); }},
      {"Diagnose",
       [](client::Session& s) { return said(s.diagnose("cell-7", "none", "", false)); }},
      {"CheckHealth",
       [](client::Session& s) { return said(s.check_health("cell-7", "none", "", 0.1)); }},
      {"Train", [](client::Session& s) { return said(s.train("cell-7", {"none"}, "", "")); }},
      {"activate", [](client::Session& s) { return said(s.activate("cell-7", 77)); }},
      {"rollback", [](client::Session& s) { return said(s.rollback("cell-7")); }},
      {"import", [](client::Session& s) { return said(s.import_model("cell-7", "no model")); }},
      {"release",
       [](client::Session& s) { return said(s.release("cell-7", "none").map([] { return 0; })); }},
      {"discard",
       [](client::Session& s) { return said(s.discard("cell-7", "none").map([] { return 0; })); }},
      {"apply a diagnosis",
       [](client::Session& s) { return said(s.diagnose("cell-7", "none", "", true)); }},
  };
  return all;
}

const std::map<std::string, std::set<std::string>> kMay = {
    {"server", {}},  // it answers
    {"observer", {"ReadModels"}},
    {"cam", {"ReadModels", "PredictError", "CorrectTarget"}},
    {"metrologist",
     {"ReadModels", "PredictError", "CorrectTarget", "SubmitMeasurements", "Diagnose",
      "CheckHealth"}},
    {"engineer",
     {"ReadModels", "PredictError", "CorrectTarget", "SubmitMeasurements", "Diagnose",
      "CheckHealth", "Train", "activate", "rollback", "import", "release", "discard",
      "apply a diagnosis"}},
};

TEST_F(SecurityTest, EachRoleMayDoWhatItsPermissionsSayAndNothingElse) {
  daemon_.start();
  for (const auto& [role, may] : kMay) {
    const auto opened = session(keys().of(role, role + "-1"));
    ASSERT_TRUE(opened) << opened.error().message;
    ASSERT_TRUE(may.empty() || (*opened)->servers()) << role;
    for (const auto& [operation, call] : calls()) {
      const Error error = call(**opened);
      const bool forbidden = error.message.starts_with("these permissions do not allow");
      EXPECT_EQ(forbidden, !may.contains(operation))
          << role << ", " << operation << ": " << error.message;
      EXPECT_NE(error.code, ErrorCode::kUnreachable)
          << role << ", " << operation << ": " << error.message;
    }
  }
}

TEST_F(SecurityTest, WhoHasNoRightCertificateIsRefusedAndCounted) {
  const std::string revoked = keys().of("engineer", "left-the-plant");
  keys().revoke("left-the-plant");
  daemon_.start();
  EXPECT_EQ(refused_handshakes(), 0);
  {
    SCOPED_TRACE("none");
    expect_nobody("");
    EXPECT_GT(refused_handshakes(), 0);
  }
  {
    SCOPED_TRACE("of another plant");
    Keys others;
    const int before = refused_handshakes();
    expect_nobody(others.of("engineer", "stranger"));
    EXPECT_GT(refused_handshakes(), before);
  }
  {
    SCOPED_TRACE("revoked, by one who does not take the news");
    const int before = refused_handshakes();
    fs::copy_file(keys().authority() + "/identity_ca.cert.pem", revoked + "/identity_ca.cert.pem",
                  fs::copy_options::overwrite_existing);
    expect_nobody(revoked);
    EXPECT_GT(refused_handshakes(), before);
  }
  {
    SCOPED_TRACE("permissions that somebody signed himself");
    Keys others;
    const std::string mine = others.of("engineer", "cam-2"), given = keys().of("cam", "cam-2");
    for (const char* file : {"permissions_ca.cert.pem", "governance.p7s", "permissions.p7s"})
      fs::copy_file(mine + "/" + file, given + "/" + file, fs::copy_options::overwrite_existing);
    expect_nobody(given);
  }
  const auto opened = session(keys().of("cam", "cam-1"));
  ASSERT_TRUE(opened) << opened.error().message;
  EXPECT_TRUE((*opened)->servers());
}

TEST_F(SecurityTest, WhoseCertificateHasEndedMeanwhileIsNotLetInAgain) {
  const std::int64_t ends = std::time(nullptr) + 5;
  const std::string visitor = keys().until(fmt::format("@{}", ends), "engineer", "visitor");
  daemon_.start();
  client::SessionOptions options = daemon_.session_options();
  options.security = visitor;
  options.timeout = kInVain;
  const auto opened = client::Session::open(options);
  ASSERT_TRUE(opened) << opened.error().message;
  ASSERT_TRUE((*opened)->servers()) << "it is good until then";
  while (client::check_security(visitor) || std::time(nullptr) < ends + 2) {
    ASSERT_FALSE(daemon_.process().wait(std::chrono::milliseconds(100)));
    ASSERT_LT(std::time(nullptr), ends + 4);
  }
  daemon_.kill();
  daemon_.start();
  const auto models = (*opened)->models("cell-7");
  ASSERT_FALSE(models);
  EXPECT_EQ(models.error().code, ErrorCode::kUnreachable);
  EXPECT_GT(refused_handshakes(), 0);
  const auto other = session(keys().of("cam", "cam-1"));
  ASSERT_TRUE(other) << other.error().message;
  EXPECT_TRUE((*other)->servers()) << "others are served";
}

TEST_F(SecurityTest, TheAuditTrailAndTheLogNameTheCertificate) {
  std::string config = test::read_file(daemon_.config_path());
  const std::size_t log = config.find("log: {") + 6;
  ASSERT_TRUE(write_text_file(daemon_.config_path(), config.insert(log, "format: json, ")));
  daemon_.start();
  const auto name_in_audit = [&](const std::string& name, const std::string& batch) {
    const auto opened = session(keys().of("engineer", name));
    ASSERT_TRUE(opened) << opened.error().message;
    const auto job =
        (*opened)->submit_measurements("cell-7", batch, test::virtual_batch_csv(80, batch[0]));
    ASSERT_TRUE(job) << job.error().message;
    const auto trail = (*opened)->audit("cell-7", 0, 100);
    ASSERT_TRUE(trail) << trail.error().message;
    const auto rows = nlohmann::json::parse(trail->at(0).json).at("rows");
    const auto row = std::find_if(rows.begin(), rows.end(), [&](const auto& r) {
      return r.at("subject") == "batch " + batch;
    });
    ASSERT_NE(row, rows.end()) << rows.dump();
    EXPECT_TRUE(
        daemon_.process().wait_for_line("\"who\":\"CN=" + name + ",O=Trammel\"", kSecurityLimit));
    const std::string who = row->at("who");
    EXPECT_TRUE(who.starts_with("CN=" + name + ",O=Trammel client ")) << who;
  };
  name_in_audit("engineer-1", "first");
  name_in_audit("engineer-2", "second");
}

TEST_F(SecurityTest, AnswersDoNotGoToAPartitionOfSomebodyElseWhateverTheCertificateAllows) {
  daemon_.start();
  using Read = wire::ReadModels;
  const std::string cam = keys().of("cam", "cam-1"), spy = keys().of("engineer", "engineer-1");
  test::RawClient<Read> victim(daemon_.domain(), daemon_.port(), "of-cam", cam),
      thief(daemon_.domain(), daemon_.port(), "of-thief", spy);
  ASSERT_TRUE(victim.wait_until_matched());
  ASSERT_TRUE(thief.wait_until_matched());
  wire::ReadModelsRequest request;
  request.what(wire::READ_MODELS);
  request.about().cell("cell-7");
  thief.send_for("of-cam", request, 1);
  thief.send(request, 2);
  EXPECT_EQ(thief.wait_for_replies(1).size(), 1U);
  victim.send(request, 1);
  EXPECT_EQ(victim.wait_for_replies(1).size(), 1U)
      << "its own answer, and none to the other's question";
  EXPECT_EQ(victim.replies(), 1U);
}

TEST_F(SecurityTest, ADatagramWithoutACertificateSendsNobodyAway) {
  daemon_.start();
  test::RawClient<wire::ReadModels> client(daemon_.domain(), daemon_.port(), "of-cam",
                                           keys().of("cam", "cam-1"));
  ASSERT_TRUE(client.wait_until_matched());
  test::Prefix who{};
  const auto octets = client.writer_octets();
  std::copy_n(octets.begin(), who.size(), who.begin());
  test::RawParticipant stranger(daemon_.port(), daemon_.domain());
  stranger.set_prefix(who);
  wire::ReadModelsRequest request;
  request.what(wire::READ_MODELS);
  request.about().cell("cell-7");
  const auto gone =
      test::ParameterList().guid(0x0070, who, 0x000001c1).add(0x0071, {0, 0, 0, 3}).bytes();
  const auto short_lived = stranger.announcement().add(0x0002, {0, 0, 0, 0, 1, 0, 0, 0}).payload();
  for (std::int64_t number = 1; number <= 50; ++number) {
    stranger.send(test::Packet(who).data({0, test::kAnnouncerId, 1000 + number, gone, {}}).bytes());
    stranger.send(
        test::Packet(who).data({0, test::kAnnouncerId, 2000 + number, {}, short_lived}).bytes());
    client.send(request, number);
    ASSERT_GE(client.wait_for_replies(static_cast<std::size_t>(number)).size(),
              static_cast<std::size_t>(number));
    ASSERT_TRUE(client.is_matched()) << "it was sent away, and has come back";
  }
}

// Without signatures our reader would skip the client's next thousand requests, and answer none of
// them.
TEST_F(SecurityTest, ADatagramWithoutASignatureMakesNoReaderSkipWhatAClientAsks) {
  daemon_.start();
  test::RawClient<wire::ReadModels> client(daemon_.domain(), daemon_.port(), "of-cam",
                                           keys().of("cam", "cam-1"));
  ASSERT_TRUE(client.wait_until_matched());
  test::Prefix who{};
  const auto octets = client.writer_octets();
  std::copy_n(octets.begin(), who.size(), who.begin());
  std::uint32_t writer = 0;
  for (std::size_t i = who.size(); i < octets.size(); ++i) writer = writer << 8 | octets[i];
  test::RawParticipant stranger(daemon_.port(), daemon_.domain());
  ASSERT_TRUE(stranger.meet(kSecurityLimit)) << "it learns where samples are read";
  stranger.set_prefix(who);
  const test::PacketBytes no_key(20);
  std::uint32_t count = 100'000;
  constexpr std::uint32_t kReaders = 64,
                          kReaderKind = 0x04;  // the service's readers are among these
  // In the clear, and as if the message, or the submessage, were signed.
  const auto pretend = [&](unsigned char begin, unsigned char end, std::int64_t skipped) {
    test::Packet heartbeat(who), gap(who);
    if (begin != 0) heartbeat.submessage(begin, 1, no_key);
    if (begin != 0) gap.submessage(begin, 1, no_key);
    ++count;
    for (std::uint32_t reader = 1; reader <= kReaders; ++reader) {
      heartbeat.heartbeat(reader << 8 | kReaderKind, writer, skipped, skipped, count);
      gap.gap(reader << 8 | kReaderKind, writer, 1, skipped);
    }
    if (end != 0) heartbeat.submessage(end, 1, no_key);
    if (end != 0) gap.submessage(end, 1, no_key);
    stranger.send(heartbeat.bytes());
    stranger.send(gap.bytes());
  };
  wire::ReadModelsRequest request;
  request.what(wire::READ_MODELS);
  request.about().cell("cell-7");
  for (std::int64_t number = 1; number <= 10; ++number) {
    for (const auto& [begin, end] :
         {std::pair<unsigned char, unsigned char>{0, 0}, {0x33, 0x34}, {0x31, 0x32}})
      pretend(begin, end, 1000 + number);
    client.send(request, number);
    ASSERT_GE(client.wait_for_replies(static_cast<std::size_t>(number)).size(),
              static_cast<std::size_t>(number));
  }
}

TEST_F(SecurityTest, WhatIsWrongWithAFolderIsSaidBeforeAnythingIsSent) {
  const std::string good = keys().of("cam", "cam-1");
  const auto spoiled = [&](const std::string& name,
                           const std::function<void(const std::string& folder)>& spoil) {
    const std::string copy = keys().authority() + "/" + name;
    fs::copy(good, copy);
    spoil(copy);
    const auto subject = client::check_security(copy);
    return subject ? Error{} : subject.error();
  };
  const auto expect = [](const Error& error, const std::string& file, const std::string& word) {
    EXPECT_TRUE(error.file.ends_with(file)) << error.file << ": " << error.message;
    EXPECT_NE(error.message.find(word), std::string::npos) << error.message;
  };
  expect(spoiled("a", [](const std::string& f) { fs::remove(f + "/governance.p7s"); }),
         "governance.p7s", "");
  expect(
      spoiled("b", [](const std::string& f) { fs::permissions(f + "/key.pem", fs::perms(0644)); }),
      "key.pem", "read");
  expect(spoiled("c",
                 [](const std::string& f) {
                   std::string text = test::read_file(f + "/permissions.p7s");
                   text.replace(text.find("ReadModels"), 10, "TrainTrain");
                   ASSERT_TRUE(write_text_file(f + "/permissions.p7s", text));
                 }),
         "permissions.p7s", "signed");
  expect(spoiled("d",
                 [](const std::string& f) {
                   fs::copy_file(keys().of("engineer", "engineer-1") + "/permissions.p7s",
                                 f + "/permissions.p7s", fs::copy_options::overwrite_existing);
                 }),
         "permissions.p7s", "engineer-1");
  expect(spoiled("e",
                 [](const std::string& f) {
                   fs::copy_file(keys().of("engineer", "engineer-1") + "/key.pem", f + "/key.pem",
                                 fs::copy_options::overwrite_existing);
                 }),
         "key.pem", "key");
  Keys others;
  expect(spoiled("f",
                 [&](const std::string& f) {
                   fs::copy_file(others.authority() + "/identity_ca.cert.pem",
                                 f + "/identity_ca.cert.pem", fs::copy_options::overwrite_existing);
                 }),
         "cert.pem", "");
  keys().of("engineer", "gone");
  keys().revoke("gone");
  const auto gone = client::check_security(keys().of("engineer", "gone"));
  ASSERT_FALSE(gone);
  expect(gone.error(), "cert.pem", "revoked");
  EXPECT_EQ(client::check_security(good).value(), "CN=cam-1,O=Trammel");
}

TEST_F(SecurityTest, TheLogNamesWhoIsRefusedAlsoWhatTheStopCutsShort) {
  Keys others;
  const std::string stranger = others.of("engineer", "stranger"),
                    later = others.of("engineer", "came-later");
  daemon_.start();
  expect_nobody(stranger);
  EXPECT_TRUE(daemon_.process().wait_for_line("says it is CN=stranger,O=Trammel, at 127.0.0.1",
                                              kSecurityLimit));
  expect_nobody(later);
  daemon_.process().signal(SIGTERM);
  EXPECT_TRUE(
      daemon_.process().wait_for_line("says it is CN=came-later,O=Trammel", kSecurityLimit));
}

TEST_F(SecurityTest, AServiceWithTheCertificateOfAClientIsToldWhichRoleItNeeds) {
  const std::string text = test::read_file(daemon_.config_path());
  const std::string folder = keys().of("cam", "cam-1"), service = keys().of("server", "line-3");
  ASSERT_TRUE(
      write_text_file(daemon_.config_path(),
                      std::string(text).replace(text.find(service), service.size(), folder)));
  for (const bool check : {true, false}) {
    std::vector<std::string> words = {test::trammeld_path(), "--config", daemon_.config_path()};
    if (check) words.push_back("--check");
    const auto done = test::run(words);
    EXPECT_EQ(done.exit_code, 3);
    EXPECT_NE(
        done.err.find("CN=cam-1,O=Trammel has the role cam, and a service needs the role server"),
        std::string::npos)
        << done.err;
    EXPECT_EQ(done.err.find("ServiceStatus"), std::string::npos) << done.err;
  }
}

/// A plant of its own; what its script says, and whose certificates count there.
class PlantTest : public testing::Test {
 protected:
  PlantTest() { EXPECT_EQ(keys("init").exit_code, 0); }
  [[nodiscard]] std::string plant() const { return folder_.path().string(); }
  /// `before` stands before the plant's folder, `words` behind it.
  test::Finished keys(const std::string& before, std::vector<std::string> words = {}) const {
    words.insert(words.begin(), {TRAMMEL_SOURCE_DIR "/deploy/security/keys", before, plant()});
    return test::run(words);
  }
  void issue(const std::string& role, const std::string& name) const {
    const auto done = keys("issue", {role, name});
    ASSERT_EQ(done.exit_code, 0) << done.err;
  }
  /// The certificate is of this plant and was not revoked: as every service would hold it, once it
  /// has the list.
  [[nodiscard]] bool counts(const std::string& certificate) const {
    std::vector<std::string> words = {"/usr/bin/openssl", "verify", "-CAfile",
                                      of("bob") + "/identity_ca.cert.pem"};
    if (fs::exists(plant() + "/authority/revoked.pem")) words.push_back("-crl_check");
    words.push_back(certificate);
    return test::run(words).exit_code == 0;
  }
  [[nodiscard]] std::string of(const std::string& name) const {
    return plant() + "/participants/" + name;
  }
  /// The certificate that the participant has now, to compare with later ones.
  [[nodiscard]] std::string kept(const std::string& name, const std::string& as) const {
    fs::copy_file(of(name) + "/cert.pem", plant() + "/" + as);
    return plant() + "/" + as;
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(PlantTest, RevokingANameRevokesItsEarlierCertificatesToo) {
  issue("cam", "bob");
  issue("engineer", "anna");
  const std::string first = kept("anna", "first.pem");
  issue("engineer", "anna");
  const std::string second = kept("anna", "second.pem");
  ASSERT_TRUE(counts(first));
  ASSERT_TRUE(counts(second));
  fs::remove_all(of("anna"));  // was moved to its host
  EXPECT_EQ(keys("revoke", {"anna"}).exit_code, 0);
  EXPECT_FALSE(counts(first));
  EXPECT_FALSE(counts(second));
  EXPECT_TRUE(counts(of("bob") + "/cert.pem"));
}

TEST_F(PlantTest, ASecondRevocationSaysSo) {
  issue("cam", "bob");
  EXPECT_EQ(keys("revoke", {"bob"}).exit_code, 0);
  const auto again = keys("revoke", {"bob"});
  EXPECT_EQ(again.exit_code, 0);
  EXPECT_NE(again.out.find("bob is revoked already"), std::string::npos) << again.out << again.err;
  EXPECT_EQ(keys("revoke", {"nobody"}).exit_code, 2);
}

TEST_F(PlantTest, ARevokedNameMayComeBackInItsRoleAndOnlyItsNewCertificateCounts) {
  issue("engineer", "bob");
  const std::string old = kept("bob", "old.pem");
  EXPECT_EQ(keys("revoke", {"bob"}).exit_code, 0);
  issue("engineer", "bob");
  EXPECT_FALSE(counts(old));
  EXPECT_TRUE(counts(of("bob") + "/cert.pem"));
}

TEST_F(PlantTest, ANameKeepsItsRoleSinceItsOldPermissionsWouldCountBesideANewCertificate) {
  issue("engineer", "anna");
  const std::string certificate = test::read_file(of("anna") + "/cert.pem");
  const auto refused = [&] {
    const auto done = keys("issue", {"cam", "anna"});
    EXPECT_EQ(done.exit_code, 2);
    return done.err;
  };
  EXPECT_NE(refused().find("anna was engineer"), std::string::npos);
  fs::remove(plant() + "/authority/roles");  // a plant from before roles were remembered
  EXPECT_NE(refused().find("anna was engineer"), std::string::npos);
  EXPECT_EQ(test::read_file(of("anna") + "/cert.pem"), certificate) << "nothing was changed";
  EXPECT_EQ(keys("revoke", {"anna"}).exit_code, 0);
  EXPECT_NE(refused().find("anna was engineer"), std::string::npos)
      << "its permissions are still about";
  fs::remove_all(of("anna"));
  EXPECT_NE(refused().find("has had a certificate"), std::string::npos)
      << "and nothing says of which role";
}

TEST_F(PlantTest, ACertificateThatHasEndedBeforeItBeginsIsNotIssued) {
  for (const auto& [option, value] :
       {std::pair{"--until", "2020-01-31T12:00:00Z"}, {"--days", "0"}, {"--days", "x"}}) {
    const auto done = keys("issue", {"cam", "carl", option, value});
    EXPECT_EQ(done.exit_code, 2) << value;
    EXPECT_NE(done.err.find(value[0] == 'x' ? "a whole number" : "has passed"), std::string::npos)
        << done.err;
    EXPECT_FALSE(fs::exists(of("carl"))) << value;
  }
}

TEST(SecurityOfTheServerFile, AnAddressThatOthersReachNeedsCertificatesOrASecondWord) {
  const test::Daemon daemon;
  const std::string text = test::read_file(daemon.config_path());
  const auto check = [&](const std::string& dds) {
    EXPECT_TRUE(write_text_file(daemon.config_path(), text + "dds: {" + dds + "}\n"));
    return test::run({test::trammeld_path(), "--config", daemon.config_path(), "--check"});
  };
  const auto once = check("address: 192.0.2.1, allow_network: true");
  EXPECT_EQ(once.exit_code, 3);
  EXPECT_NE((once.out + once.err).find("without_security"), std::string::npos)
      << once.out << once.err;
  const auto twice = check("address: 192.0.2.1, allow_network: true, without_security: true");
  EXPECT_EQ((twice.out + twice.err).find("without_security"), std::string::npos)
      << twice.out << twice.err;
  const auto bad = check("security: nowhere");
  EXPECT_EQ(bad.exit_code, 3);
  EXPECT_NE((bad.out + bad.err).find("nowhere"), std::string::npos) << bad.out << bad.err;
}

}  // namespace
}  // namespace trammel
