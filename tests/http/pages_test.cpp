#include "server/http/pages.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "server/http/page_shell.h"
#include "server/report/page_policy.h"
#include "tests/http/watched_server.h"

namespace trammel {
namespace {

constexpr const char* kHostile = "<script>alert(1)</script>&\"'onload=x";

/// The words of an address as they come from outside.
HttpAsk ask(const std::string& address) {
  HttpAsk asked;
  std::size_t at = 1;
  while (at < address.size()) {
    const std::size_t end = std::min(address.find('/', at), address.size());
    std::string word;
    for (std::size_t i = at; i < end; ++i) {
      const bool is_byte = address[i] == '%';
      word += is_byte ? static_cast<char>(std::stoi(address.substr(i + 1, 2), nullptr, 16))
                      : address[i];
      if (is_byte) i += 2;
    }
    asked.path.push_back(word);
    at = end + 1;
  }
  return asked;
}

std::set<std::string> links_of(const std::string& page) {
  static const std::regex kLink("<a href=\"(/[^\"]*)\"");
  std::set<std::string> links;
  for (auto at = std::sregex_iterator(page.begin(), page.end(), kLink);
       at != std::sregex_iterator(); ++at)
    links.insert((*at)[1]);
  return links;
}

class PagesTest : public testing::Test {
 protected:
  HttpReply page(const std::string& address, ServerPhase phase = ServerPhase::kServing) {
    const Watched watched = server_.watched();
    Pages pages(watched);
    return pages.answer(ask(address), phase);
  }
  /// All pages that can be reached by links, from the first one on.
  std::map<std::string, HttpReply> all_pages() {
    std::map<std::string, HttpReply> pages;
    std::set<std::string> left = {"/"};
    while (!left.empty()) {
      const std::string address = *left.begin();
      left.erase(left.begin());
      pages[address] = page(address);
      for (const std::string& link : links_of(pages[address].body))
        if (!pages.contains(link)) left.insert(link);
    }
    return pages;
  }
  test::WatchedServer server_;
};

TEST_F(PagesTest, TheFleetSaysWhichCellsAreDarkAndWhy) {
  EXPECT_NE(page("/").body.find("Its cell is not fine; act now: cell-7."), std::string::npos);
  EXPECT_NE(page("/").body.find("submit a batch"), std::string::npos);
  server_.submit("cell-7", "b1", 1);
  server_.work();
  EXPECT_NE(page("/").body.find("Its cell is fine."), std::string::npos);
}

TEST_F(PagesTest, AModelAndItsLastCheckLeadToEachOtherAndSayTheSameDay) {
  server_.submit("cell-7", "b1", 1);
  server_.work();
  test::SmallBatch few;
  few.poses = 12;
  few.seed = 5;
  const auto job = test::demand(server_.trainer().check(
      "cell-7", "", test::small_batch_csv(*test::small_cell("cell-7"), few), 1.0));
  server_.work();
  const std::string findings = fmt::format("/jobs/{}/findings", job);
  const std::string model = page("/cells/cell-7/models/1").body, health = page(findings).body;
  EXPECT_NE(model.find("<a href=\"" + findings + "\">Last check</a>"), std::string::npos);
  EXPECT_TRUE(links_of(health).contains("/cells/cell-7/models/1")) << health;
  const auto json = nlohmann::json::parse(page(findings + ".json").body);
  const std::string due = json.value("due", "");
  ASSERT_FALSE(due.empty()) << json.dump();
  EXPECT_NE(model.find("check again by " + due), std::string::npos) << due;
  EXPECT_NE(health.find(due), std::string::npos);
  EXPECT_NE(page("/").body.find("next check by " + due), std::string::npos) << page("/").body;
}

TEST_F(PagesTest, EveryLinkLeadsToAPageAndEveryPageIsReached) {
  server_.submit("cell-7", "b1", 1);
  server_.submit("cell-7", "b2", 2);
  server_.work();
  const auto pages = all_pages();
  for (const auto& [address, reply] : pages)
    EXPECT_EQ(reply.code, 200) << address << "\n" << reply.body.substr(0, 300);
  for (const char* address : {"/", "/jobs", "/jobs/1", "/jobs/2", "/cells/cell-7",
                              "/cells/cell-7/history", "/cells/cell-7/models/1"})
    EXPECT_TRUE(pages.contains(address)) << address;
  EXPECT_NE(pages.at("/cells/cell-7").body.find("in force"), std::string::npos);
  EXPECT_NE(pages.at("/cells/cell-7/models/1").body.find("What was identified"), std::string::npos);
}

TEST_F(PagesTest, WhatIsNotThereIsSaidSo) {
  for (const char* address :
       {"/cells/cell-9", "/cells/cell-7/models/7", "/cells/cell-7/models/x", "/jobs/77", "/jobs/-1",
        "/nothing", "/cells", "/cells/cell-7/models/1/more", "/jobs/1/findings"})
    EXPECT_EQ(page(address).code, 404) << address;
  EXPECT_EQ(page("/", ServerPhase::kStarting).code, 503);
  EXPECT_EQ(page("/", ServerPhase::kStopping).code, 503);
}

TEST_F(PagesTest, APolicyLetsOurOwnScriptsRunAndNothingElse) {
  server_.submit("cell-7", "b1", 1);
  server_.work();
  for (const auto& [address, reply] : all_pages()) {
    const std::string policy = reply.headers.at("Content-Security-Policy");
    EXPECT_EQ(policy.find("unsafe"), std::string::npos) << address;
    EXPECT_NE(policy.find("default-src 'none'"), std::string::npos) << address;
    for (const std::string& style : inserts_of(reply.body).styles)
      EXPECT_NE(
          policy.find(
              content_policy({{}, {style}})
                  .substr(std::string("default-src 'none'; script-src 'none'; style-src ").size(),
                          53)),
          std::string::npos)
          << address << " has a style that its policy forbids";
    for (const std::string& script : inserts_of(reply.body).scripts)
      EXPECT_NE(policy.find(content_policy({{script}, {}})
                                .substr(std::string("default-src 'none'; script-src ").size(), 53)),
                std::string::npos)
          << address << " has a script that its policy forbids";
    EXPECT_EQ(reply.body.find(" style=\""), std::string::npos) << address;
    EXPECT_EQ(reply.body.find(" onclick"), std::string::npos) << address;
  }
}

TEST_F(PagesTest, NamesThatAreHtmlAreShownAsTheyStand) {
  const std::string cell = std::string("c") + kHostile;
  server_.take_down();
  auto named = *test::small_cell("cell-7");
  named.name = cell;
  server_.set_cells({{cell, std::make_shared<const Cell>(named)}});
  server_.set_up();
  server_.submit(cell, std::string("b") + kHostile, 1);
  server_.work();
  const auto pages = all_pages();
  EXPECT_GE(pages.size(), 5u) << "the links of such names work";
  for (const auto& [address, reply] : pages) {
    EXPECT_EQ(reply.code, 200) << address;
    EXPECT_EQ(reply.body.find("<script>alert"), std::string::npos) << address;
    EXPECT_EQ(reply.headers.at("Content-Security-Policy").find("alert"), std::string::npos);
    EXPECT_EQ(reply.headers.at("Content-Security-Policy")
                  .find(content_policy({{"alert(1)"}, {}}).substr(31, 53)),
              std::string::npos)
        << address;
  }
  EXPECT_NE(pages.at("/").body.find("&lt;script&gt;alert(1)"), std::string::npos);
}

}  // namespace
}  // namespace trammel
