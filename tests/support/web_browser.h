#pragma once

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "tests/support/http_client.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

/// A real browser (Debian's chromium) controlled by WebDriver, with a profile of its own. Ends with
/// the test.
class WebBrowser {
 public:
  static constexpr const char* kDriver = "/usr/bin/chromedriver";
  [[nodiscard]] static bool is_there() { return std::filesystem::exists(kDriver); }

  WebBrowser() : driver_({kDriver, "--port=0", "--log-level=SEVERE"}) {
    EXPECT_TRUE(driver_.wait_for_line("started successfully on port", kLimit))
        << driver_.standard_error();
    std::smatch found;
    const std::string said = driver_.standard_output();
    if (std::regex_search(said, found, std::regex("successfully on port ([0-9]+)")))
      port_ = static_cast<std::uint16_t>(std::stoi(found[1]));
    const nlohmann::json options = {
        {"args",
         {"--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
          "--disable-background-networking", "--user-data-dir=" + folder_.file("profile")}}};
    const nlohmann::json opened =
        ask("POST", "/session",
            {{"capabilities",
              {{"alwaysMatch",
                {{"goog:chromeOptions", options}, {"goog:loggingPrefs", {{"browser", "ALL"}}}}}}}});
    if (opened.contains("sessionId"))
      session_ = "/session/" + opened["sessionId"].get<std::string>();
  }
  ~WebBrowser() {
    if (!session_.empty()) ask("DELETE", session_, nullptr);
    driver_.signal(SIGTERM);
    EXPECT_TRUE(driver_.wait(kLimit));
  }
  WebBrowser(const WebBrowser&) = delete;
  WebBrowser& operator=(const WebBrowser&) = delete;

  /// As narrow as one likes, px.
  void resize(int width, int height) {
    ask("POST", session_ + "/goog/cdp/execute",
        {{"cmd", "Emulation.setDeviceMetricsOverride"},
         {"params",
          {{"width", width}, {"height", height}, {"deviceScaleFactor", 1}, {"mobile", false}}}});
  }
  /// Until it is loaded.
  void open(const std::string& address) { ask("POST", session_ + "/url", {{"url", address}}); }
  /// The return value of JavaScript that runs in the page.
  nlohmann::json run(const std::string& script) {
    return ask("POST", session_ + "/execute/sync",
               {{"script", script}, {"args", nlohmann::json::array()}});
  }
  /// PNG.
  std::string screenshot() {
    const nlohmann::json shot = ask("GET", session_ + "/screenshot", nullptr);
    return shot.is_string() ? decoded(shot.get<std::string>()) : "";
  }
  /// The complaints of the console and the policy since the last call.
  std::vector<std::string> complaints() {
    std::vector<std::string> all;
    for (const nlohmann::json& one : ask("POST", session_ + "/se/log", {{"type", "browser"}}))
      all.push_back(one.value("level", "") + " " + one.value("message", ""));
    return all;
  }

 private:
  static constexpr std::chrono::seconds kLimit{30};

  nlohmann::json ask(const std::string& method, const std::string& path,
                     const nlohmann::json& body) {
    if (is_gone_) return {};
    const std::string text = body.is_null() ? "" : body.dump();
    const OpenConnection connection(port_);
    connection.send(
        fmt::format("{} {} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: application/json\r\n"
                    "Content-Length: {}\r\n\r\n{}",
                    method, path, port_, text.size(), text));
    const HttpAnswer answer = parse_http(connection.read_answer(kLimit));
    is_gone_ = answer.code == 0;
    const nlohmann::json json = nlohmann::json::parse(answer.body, nullptr, false);
    EXPECT_EQ(answer.code, 200) << method << " " << path << "\n" << answer.body.substr(0, 400);
    return answer.code == 200 && json.is_object() ? json.value("value", nlohmann::json())
                                                  : nlohmann::json();
  }
  static std::string decoded(const std::string& base64) {
    static const std::string kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string bytes;
    unsigned value = 0;
    int bits = 0;
    for (const char c : base64) {
      const std::size_t digit = kDigits.find(c);
      if (digit == std::string::npos) break;
      value = value << 6 | static_cast<unsigned>(digit);
      if ((bits += 6) < 8) continue;
      bytes += static_cast<char>(value >> (bits -= 8) & 0xff);
    }
    return bytes;
  }

  TemporaryFolder folder_;
  Process driver_;
  std::uint16_t port_ = 0;
  std::string session_;
  bool is_gone_ = false;
};

}  // namespace trammel::test
