#include "server/gateway/gateway.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "server/base/hash.h"
#include "server/dds/dds_service.h"
#include "server/http/http_server.h"
#include "tests/dds/backend.h"
#include "tests/support/http_client.h"
#include "tests/support/own_ports.h"
#include "tests/support/web_browser.h"

namespace trammel {
namespace {

using nlohmann::json;
using test::http_exchange;
using test::HttpAnswer;
using test::parse_http;

constexpr const char* kPoses =
    R"({"poses": [{"pose_id": "a", "joints_deg": [5, 10, 15, 20, 25, 30]}]})";
const std::string kProgram =
    "MODULE weld ! \xe4 is no UTF-8\r\n"
    "  CONST jointtarget jA:=[[5,10,15,20,25,30],[9E9,9E9,9E9,9E9,9E9,9E9]];\r\n"
    "  PROC main()\r\n    MoveAbsJ jA,v100,fine,spindle;\r\n  ENDPROC\r\nENDMODULE\r\n";

/// An address of the description, with a cell and a job in it.
std::string filled_in(std::string path) {
  for (const auto& [word, with] :
       {std::pair<std::string, std::string>{"{cell}", "cell-7"}, {"{job}", "1"}}) {
    const std::size_t at = path.find(word);
    if (at != std::string::npos) path.replace(at, word.size(), with);
  }
  return "/api/v1" + path;
}

struct Sent {
  std::string method = "POST", path, body = {}, type = "application/json", headers = {};
};

/// A service that answers on DDS and over HTTP; its model predicts 0.3 mm along x everywhere.
class GatewayTest : public testing::Test {
 protected:
  void start(const std::string& tokens = "") {
    backend_.serve(3);
    DdsOptions options = test::test_dds_options();
    options.local_calls = true;
    service_ = std::make_unique<DdsService>(options, *backend_.trainer, *backend_.store,
                                            backend_.registry);
    const Status started = service_->start();
    ASSERT_TRUE(started) << started.error().message;
    gateway_ = std::make_unique<Gateway>(
        backend_.registry, [this](const auto& work) { return service_->with_calls(work); },
        "0.1.0");
    HttpOptions http;
    http.port = test::own_ports();
    http.api = true;
    http.tokens = tokens;
    port_ = http.port;
    http_ = std::make_unique<HttpServer>(
        http,
        Watched{"server-a", "0.1.0", "trammel.db", *backend_.trainer, *backend_.store,
                backend_.registry, [this] { return service_->figures(); },
                [this] { return service_->movement(); }},
        gateway_->api());
    const Status listens = http_->start();
    ASSERT_TRUE(listens) << listens.error().message;
    http_->set_phase(ServerPhase::kServing);
  }
  void TearDown() override {
    http_.reset();
    service_.reset();
  }

  HttpAnswer send(const Sent& sent) const {
    std::string text =
        sent.method + " " + sent.path +
        " HTTP/1.1\r\nConnection: close\r\nHost: 127.0.0.1:" + std::to_string(port_) + "\r\n" +
        sent.headers;
    if (sent.method == "POST")
      text += "Content-Type: " + sent.type +
              "\r\nContent-Length: " + std::to_string(sent.body.size()) + "\r\n";
    return parse_http(http_exchange(port_, text + "\r\n" + sent.body));
  }
  json get(const std::string& path) const { return json::parse(send({"GET", path}).body); }

  std::string tokens_file(const std::string& text) {
    const std::string path = backend_.folder.file("tokens");
    std::ofstream(path) << text;
    ::chmod(path.c_str(), 0600);
    return path;
  }

  test::Backend backend_;
  std::unique_ptr<DdsService> service_;
  std::unique_ptr<Gateway> gateway_;
  std::unique_ptr<HttpServer> http_;
  std::uint16_t port_ = 0;
};

TEST_F(GatewayTest, PredictsWhatTheModelInForceSays) {
  start();
  const HttpAnswer answer = send({.path = "/api/v1/cells/cell-7/predict", .body = kPoses});
  ASSERT_EQ(answer.code, 200) << answer.body;
  const json item = json::parse(answer.body)["predictions"][0];
  EXPECT_EQ(item["pose_id"], "a");
  EXPECT_NEAR(item["dx_mm"].get<double>(), 0.3, 1e-9);
  EXPECT_NEAR(item["dy_mm"].get<double>(), 0, 1e-9);
}

TEST_F(GatewayTest, ACorrectedTargetIsCommandedAgainstTheError) {
  start();
  const HttpAnswer answer =
      send({.path = "/api/v1/cells/cell-7/correct",
            .body = R"({"targets": [{"name": "t", "joints_deg": [5, 10, 15, 20, 25, 30]}]})"});
  ASSERT_EQ(answer.code, 200) << answer.body;
  const json nominal =
      json::parse(send({.path = "/api/v1/cells/cell-7/predict", .body = kPoses}).body);
  const json item = json::parse(answer.body)["targets"][0];
  EXPECT_EQ(item["status"], "ok") << item;
  EXPECT_NEAR(item["commanded"]["x_mm"].get<double>(),
              nominal["predictions"][0]["nominal"]["x_mm"].get<double>() - 0.3, 1e-4);
}

// Every byte that is no corrected number comes back, also those that are no text in any encoding.
TEST_F(GatewayTest, AProgramComesBackByteForByte) {
  start();
  const HttpAnswer answer = send({.path = "/api/v1/cells/cell-7/program?name=weld.mod",
                                  .body = kProgram,
                                  .type = "application/octet-stream"});
  ASSERT_EQ(answer.code, 200) << answer.body;
  EXPECT_NE(answer.body, kProgram);
  for (const char* kept : {"! \xe4 is no UTF-8\r\n", "],[9E9,9E9,9E9,9E9,9E9,9E9]];\r\n",
                           "  PROC main()\r\n    MoveAbsJ jA,v100,fine,spindle;\r\n"})
    EXPECT_NE(answer.body.find(kept), std::string::npos) << kept;
  EXPECT_EQ(answer.body.find("[[5,10,15,20,25,30]"), std::string::npos) << "it is not corrected";
  const json packed = {{"files", {{{"name", "weld.mod"}, {"base64", to_base64(kProgram)}}}}};
  const HttpAnswer several = send({.path = "/api/v1/cells/cell-7/programs", .body = packed.dump()});
  ASSERT_EQ(several.code, 200) << several.body;
  const json told = json::parse(several.body);
  EXPECT_EQ(from_base64(told["files"][0]["base64"].get<std::string>()), answer.body)
      << "both addresses say the same";
  EXPECT_EQ(told["receipt"]["targets"].size(), 1u);
}

// Who reads the description finds every address, and every address is described.
TEST_F(GatewayTest, TheDescriptionAndTheAddressesAreTheSame) {
  start();
  const json told = get("/api/v1/openapi.json");
  EXPECT_EQ(told["openapi"], "3.1.0");
  const std::set<std::string> known = {"/",
                                       "/openapi.json",
                                       "/status",
                                       "/jobs",
                                       "/jobs/{job}",
                                       "/cells/{cell}/jobs/{job}/findings",
                                       "/cells/{cell}/models",
                                       "/cells/{cell}/predict",
                                       "/cells/{cell}/correct",
                                       "/cells/{cell}/program",
                                       "/cells/{cell}/programs",
                                       "/cells/{cell}/batches",
                                       "/cells/{cell}/check",
                                       "/cells/{cell}/diagnose",
                                       "/cells/{cell}/activate",
                                       "/cells/{cell}/rollback",
                                       "/cells/{cell}/train"};
  std::set<std::string> described;
  for (const auto& [path, operations] : told["paths"].items()) {
    described.insert(path);
    const std::string other = operations.contains("get") ? "POST" : "GET";
    const std::string address = filled_in(path);
    EXPECT_EQ(send({.method = other, .path = address, .body = "{}"}).code, 405) << address;
  }
  EXPECT_EQ(described, known);
}

TEST_F(GatewayTest, TheDescriptionHasTheMembersOfTheAnswers) {
  start();
  const json schemas = get("/api/v1/openapi.json")["components"]["schemas"];
  const json asked = {{"poses", json::parse(kPoses)["poses"]}, {"covariance", true}};
  const json told =
      json::parse(send({.path = "/api/v1/cells/cell-7/predict", .body = asked.dump()}).body);
  const json& figures = schemas["Predictions"]["properties"]["predictions"]["items"]["properties"];
  for (const auto& [name, value] : told["predictions"][0].items())
    EXPECT_TRUE(figures.contains(name)) << name;
  for (const auto& [name, value] : told.items())
    EXPECT_TRUE(schemas["Predictions"]["properties"].contains(name)) << name;
}

/// The members that a body may have, as the refusal of another one lists them.
std::set<std::string> members_in(const std::string& refused) {
  const std::string message = json::parse(refused)["error"]["message"], before = "expected one of ";
  const std::size_t at = message.find(before);
  std::set<std::string> members;
  if (at == std::string::npos) return members;
  std::istringstream list(message.substr(at + before.size()));
  for (std::string name; std::getline(list >> std::ws, name, ',');) members.insert(name);
  return members;
}

// A member that is described and refused, or taken and not described, would lead a programmer
// astray.
TEST_F(GatewayTest, TheDescriptionHasTheMembersAndOptionsOfTheQuestions) {
  start();
  const json told = get("/api/v1/openapi.json");
  int bodies = 0, options = 0;
  for (const auto& [path, operations] : told["paths"].items()) {
    for (const auto& [method, operation] : operations.items()) {
      std::string address = filled_in(path), separator = "?";
      for (const json& parameter : operation["parameters"]) {
        if (parameter["in"] != "query") continue;
        address += separator + parameter["name"].get<std::string>() + "=1";
        separator = "&";
        ++options;
      }
      Sent sent{.method = method == "get" ? "GET" : "POST", .path = address, .body = "{}"};
      if (operation.contains("requestBody"))
        sent.type = operation["requestBody"]["content"].begin().key();
      EXPECT_EQ(send(sent).body.find("is no option"), std::string::npos) << address;
      sent.path += separator + "zz=1";
      EXPECT_NE(send(sent).body.find("'zz' is no option"), std::string::npos) << address;
      if (sent.type != "application/json" || sent.method == "GET") continue;
      ++bodies;
      const std::string named =
          operation["requestBody"]["content"]["application/json"]["schema"]["$ref"];
      const json schema = told.at(json::json_pointer(named.substr(1)));
      std::set<std::string> described;
      for (const auto& [name, member] : schema["properties"].items()) described.insert(name);
      sent.path = address;
      sent.body = R"({"zz": 1})";
      EXPECT_EQ(members_in(send(sent).body), described) << address;
    }
  }
  EXPECT_EQ(bodies, 6);
  EXPECT_GE(options, 10);
}

/// All texts behind `$ref`.
void find_references(const json& value, std::set<std::string>& found) {
  if (value.is_object() && value.contains("$ref")) found.insert(value["$ref"].get<std::string>());
  if (!value.is_structured()) return;
  for (const json& one : value) find_references(one, found);
}

TEST_F(GatewayTest, EverySchemaThatTheDescriptionNamesIsInIt) {
  start();
  const json told = get("/api/v1/openapi.json");
  std::set<std::string> references;
  find_references(told, references);
  EXPECT_GE(references.size(), 15u);
  for (const std::string& reference : references)
    EXPECT_TRUE(told.contains(json::json_pointer(reference.substr(1)))) << reference;
  for (const auto& [name, schema] : told["components"]["schemas"].items())
    EXPECT_TRUE(references.contains("#/components/schemas/" + name)) << name << " is of no use";
}

TEST_F(GatewayTest, WhoMayAskIsWhoTheDescriptionSays) {
  const std::vector<std::string> roles = {"observer", "cam", "metrologist", "engineer"};
  std::string lines;
  for (const std::string& role : roles)
    lines += "one-" + role + " " + role + " " + sha256_hex(role) + "\n";
  start(tokens_file(lines));
  const json told = json::parse(
      send({"GET", "/api/v1/openapi.json", {}, {}, "Authorization: Bearer observer\r\n"}).body);
  for (const auto& [path, operations] : told["paths"].items()) {
    for (const auto& [method, operation] : operations.items()) {
      Sent sent{.method = method == "get" ? "GET" : "POST", .path = filled_in(path), .body = "{}"};
      bool may = false;
      EXPECT_EQ(send(sent).code, 401) << path;
      for (const std::string& role : roles) {
        may = may || operation["x-role"] == role;
        sent.headers = "Authorization: Bearer " + role + "\r\n";
        EXPECT_EQ(send(sent).code != 403, may) << path << " as " << role;
      }
      EXPECT_TRUE(may) << path << " has no role";
    }
  }
}

struct Mistake {
  Sent sent;
  int code;
  const char* words;
};

TEST_F(GatewayTest, TellsEveryMistakeWithItsCodeAndInWords) {
  start();
  const std::string predict = "/api/v1/cells/cell-7/predict";
  const std::string correct = "/api/v1/cells/cell-7/correct";
  const std::string program = "/api/v1/cells/cell-7/program";
  const std::string bytes = "application/octet-stream";
  const std::vector<Mistake> mistakes = {
      {{.path = predict, .body = "{"}, 400, "JSON object"},
      {{.path = predict, .body = "[]"}, 400, "JSON object"},
      {{.path = predict, .body = "{}"}, 400, "poses"},
      {{.path = predict, .body = R"({"poses": 3})"}, 400, "a list"},
      {{.path = predict, .body = R"({"poses": [], "tol": "a"})"}, 400, "tol"},
      {{.path = predict, .body = R"({"poses": [{"joints_deg": "1"}]})"}, 400, "joint vector 1"},
      {{.path = predict, .body = R"({"poses": [{"joints_deg": [1, 2]}]})"}, 422, "joint"},
      {{.path = predict, .body = R"({"poses": [{"joints_deg": [1,2,3,4,5,6]}], "tool": "x"})"},
       422,
       "x"},
      {{.path = "/api/v1/cells/cell-9/predict", .body = kPoses}, 404, "cell-9"},
      {{.path = "/api/v1/cells/cell-8/predict", .body = kPoses}, 404, "cell-8"},
      {{.path = predict, .body = kPoses, .headers = "Trammel-Deadline-Ms: soon\r\n"}, 400, "soon"},
      {{.path = correct, .body = R"({"targets": [{"x_mm": 1, "conf": 0}]})"}, 400, "target 1"},
      {{.path = correct, .body = R"({"targets": [{"conf": 1.5}]})"}, 400, "whole number"},
      {{.path = correct,
        .body = R"({"targets": [{"x_mm": 1, "y_mm": 1, "z_mm": 1, "qw": 1, "qx": 0, "qy": 0,
                    "qz": 0}]})"},
       400,
       "branch"},
      {{.path = program, .body = kProgram, .type = bytes}, 400, "name"},
      {{.path = program + "?name=weld.txt", .body = kProgram, .type = bytes}, 400, "format"},
      {{.path = program + "?name=a.mod", .body = "MODULE a\nENDMODULE\n", .type = bytes},
       422,
       "no motion"},
      {{.path = program + "?name=a.mod&digits=3", .body = kProgram, .type = bytes}, 400, "digits"},
      {{.path = "/api/v1/cells/cell-7/batches?batch_id=b",
        .body = "no,batch\n",
        .type = "text/csv"},
       422,
       "batch"},
      {{.path = "/api/v1/cells/cell-7/activate", .body = R"({"version": 77})"}, 404, "77"},
      {{.path = "/api/v1/cells/cell-7/activate", .body = "{}"}, 400, "version"},
      {{.method = "GET", .path = "/api/v1/jobs/none"}, 400, "none"},
      {{.method = "GET", .path = "/api/v1/jobs/999"}, 404, "999"},
      {{.method = "GET", .path = "/api/v2/jobs"}, 404, "address"},
      {{.path = predict, .body = kPoses, .type = "text/plain"}, 415, "application/json"}};
  for (const Mistake& mistake : mistakes) {
    const HttpAnswer answer = send(mistake.sent);
    EXPECT_EQ(answer.code, mistake.code) << mistake.sent.path << " " << mistake.sent.body << "\n"
                                         << answer.body;
    EXPECT_NE(answer.body.find(mistake.words), std::string::npos)
        << mistake.sent.path << " " << mistake.sent.body << "\n"
        << answer.body;
  }
}

// A page of another site that a person on this host looks at must not ask in his name.
TEST_F(GatewayTest, APageOfAnotherSiteIsRefused) {
  start();
  const std::string path = "/api/v1/cells/cell-7/predict";
  const std::string own = "Origin: http://127.0.0.1:" + std::to_string(port_) + "\r\n";
  EXPECT_EQ(send({.path = path, .body = kPoses, .headers = own}).code, 200);
  for (const char* origin : {"https://evil.example", "null", "http://127.0.0.1:1"})
    EXPECT_EQ(
        send({.path = path, .body = kPoses, .headers = std::string("Origin: ") + origin + "\r\n"})
            .code,
        403)
        << origin;
}

TEST_F(GatewayTest, ATokenMayWhatItsRoleMayOnDds) {
  std::string lines;
  for (const char* role : {"observer", "cam", "metrologist", "engineer"})
    lines += std::string("one-") + role + " " + role + " " + sha256_hex(role) + "\n";
  start(tokens_file(lines));
  const std::map<std::string, int> rank = {
      {"observer", 0}, {"cam", 1}, {"metrologist", 2}, {"engineer", 3}};
  struct Asked {
    Sent sent;
    int needs;
  };
  const std::vector<Asked> asked = {
      {{.method = "GET", .path = "/api/v1/status"}, 0},
      {{.method = "GET", .path = "/api/v1/cells/cell-7/models"}, 0},
      {{.path = "/api/v1/cells/cell-7/predict", .body = kPoses}, 1},
      {{.path = "/api/v1/cells/cell-7/check", .body = "x", .type = "text/csv"}, 2},
      {{.path = "/api/v1/cells/cell-7/activate", .body = R"({"version": 77})"}, 3}};
  for (const Asked& one : asked) {
    EXPECT_EQ(send(one.sent).code, 401) << one.sent.path << ": without a token";
    for (const auto& [role, has] : rank) {
      Sent sent = one.sent;
      sent.headers = "Authorization: Bearer " + role + "\r\n";
      EXPECT_EQ(send(sent).code == 403, has < one.needs) << one.sent.path << " as " << role;
    }
  }
}

TEST_F(GatewayTest, AServiceThatHasStoppedSaysWhenToAskAgain) {
  start();
  service_->stop();
  const HttpAnswer answer = send({.path = "/api/v1/cells/cell-7/predict", .body = kPoses});
  EXPECT_EQ(answer.code, 503);
  EXPECT_NE(answer.body.find("does not run"), std::string::npos) << answer.body;
}

// Requests over HTTP stand in the same counts as those on DDS.
TEST_F(GatewayTest, ItsRequestsAreCountedWithAllOthers) {
  start();
  static_cast<void>(send({.path = "/api/v1/cells/cell-7/predict", .body = kPoses}));
  bool counted = false;
  for (const OperationFigures& figures : service_->figures().operations)
    counted =
        counted || (figures.operation == "HttpPredictError" && figures.by_result.at("ok") == 1);
  EXPECT_TRUE(counted);
}

TEST_F(GatewayTest, TheExamplesOfCurlAndPythonCorrectAProgram) {
  start();
  const std::string program = backend_.folder.file("weld.mod"),
                    url = "http://127.0.0.1:" + std::to_string(port_);
  std::ofstream(program, std::ios::binary) << kProgram;
  const std::string examples = TRAMMEL_SOURCE_DIR "/deploy/http/";
  const std::string by_curl = backend_.folder.file("by_curl.mod");
  const std::string by_python = backend_.folder.file("by_python");
  ASSERT_EQ(std::system((examples + "correct.sh " + url + " cell-7 " + program + " " + by_curl +
                         " 2>/dev/null")
                            .c_str()),
            0);
  ASSERT_EQ(std::system(("/usr/bin/python3 " + examples + "correct.py " + url + " cell-7 " +
                         by_python + " " + program + " >/dev/null")
                            .c_str()),
            0);
  const auto text_of = [](const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_NE(text_of(by_curl), "");
  EXPECT_EQ(text_of(by_curl), text_of(by_python + "/weld.mod"));
  EXPECT_NE(text_of(by_python + "/receipt.csv").find("weld.mod"), std::string::npos);
}

// A person drops a file on the page, and gets it back with its receipt; the page's own policy lets
// it.
TEST_F(GatewayTest, APersonDropsAProgramAndGetsItBackWithItsReceipt) {
  if (!test::WebBrowser::is_there()) GTEST_SKIP() << "no browser";
  start();
  test::WebBrowser browser;
  browser.open("http://127.0.0.1:" + std::to_string(port_) + "/api/v1/?cell=cell-7");
  std::string plain = kProgram;
  plain[plain.find('\xe4')] = 'a';
  const json said = browser.run("const text = " + json(plain).dump() + R"(;
    window.kept = [];
    const make = URL.createObjectURL.bind(URL);
    URL.createObjectURL = blob => { window.kept.push(blob); return make(blob); };
    const dropped = new DataTransfer();
    dropped.items.add(new File([text], 'weld.mod'));
    document.getElementById('drop').dispatchEvent(new DragEvent('drop', {dataTransfer: dropped}));
    const state = document.getElementById('state');
    return new Promise(done => {
      const look = () => state.className || /Model/.test(state.textContent)
        ? done(state.textContent) : setTimeout(look, 20);
      look();
    });)");
  EXPECT_NE(said.dump().find("1 targets"), std::string::npos) << said;
  const json files = browser.run(
      "return [...document.querySelectorAll('#links a')].map(link => link.textContent);");
  EXPECT_EQ(files, json({"weld.mod", "receipt.csv", "receipt.json"}));
  const json returned = browser.run("return window.kept[0].text();");
  const HttpAnswer direct = send({.path = "/api/v1/cells/cell-7/program?name=weld.mod",
                                  .body = plain,
                                  .type = "application/octet-stream"});
  EXPECT_EQ(returned, json(direct.body)) << "as curl gets it";
  EXPECT_EQ(browser.complaints(), std::vector<std::string>());
  for (const int width : {400, 1200}) {
    browser.resize(width, 900);
    EXPECT_EQ(browser.run("const root = document.documentElement;"
                          "return root.scrollWidth - root.clientWidth;"),
              json(0))
        << width << " px";
  }
  browser.run("document.getElementById('cell').value = 'cell-9';");
  const json wrong = browser.run(R"(
    const dropped = new DataTransfer();
    dropped.items.add(new File(['no program'], 'weld.mod'));
    document.getElementById('drop').dispatchEvent(new DragEvent('drop', {dataTransfer: dropped}));
    const state = document.getElementById('state');
    return new Promise(done => {
      const look = () => state.className ? done(state.textContent) : setTimeout(look, 20);
      look();
    });)");
  EXPECT_NE(wrong.dump().find("cell-9"), std::string::npos) << wrong;
  const auto complained = browser.complaints();  // the console tells of the 404, too
  EXPECT_EQ(complained.size(), 1u);
}

}  // namespace
}  // namespace trammel
