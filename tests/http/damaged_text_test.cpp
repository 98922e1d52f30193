// Whatever is damaged of the model in force in the store, its copy is served, and what people ask
// says so.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "server/base/hash.h"
#include "server/http/readiness.h"
#include "server/trainer/dark_cells.h"
#include "tests/http/watched_server.h"

namespace trammel {
namespace {

using test::demand;
constexpr int kFirst = 40, kInForce = 41,
              kOfOthers = 77;  // training poses, which tell the models apart

/// A store's row of a model.
struct Row {
  std::string text, hash;
};

Row row_of(const std::string& path, const std::string& cell, int version) {
  const SQLite::Database file(path);
  SQLite::Statement row(file, "SELECT content, hash FROM models WHERE cell = ? AND version = ?");
  row.bind(1, cell);
  row.bind(2, version);
  if (!row.executeStep()) return {};
  return {row.getColumn(0).getString(), row.getColumn(1).getString()};
}

std::string replaced(std::string text, const std::string& old, const std::string& with) {
  for (std::size_t at = text.find(old); at != std::string::npos;
       at = text.find(old, at + with.size()))
    text.replace(at, old.size(), with);
  return text;
}

std::string flipped(std::string text, std::size_t at) {
  text[at] = static_cast<char>(text[at] ^ 1);
  return text;
}

/// With `value` in the place of the content's first number that has a point; all hashes fit.
Row with_number(const Row& row, const std::string& value) {
  const std::string content = nlohmann::json::parse(row.text).at("content").dump();
  const std::string changed = std::regex_replace(content, std::regex("-?[0-9]+\\.[0-9]+"), value,
                                                 std::regex_constants::format_first_only);
  const std::string hash = sha256_hex(changed);
  return {replaced(replaced(row.text, content, changed), row.hash, hash), hash};
}

/// Where the texts are that do not belong there.
struct Stores {
  std::string path, other;
};
struct Damage {
  const char* name;
  std::function<Row(const Row& row, const Stores& stores)>
      of;  ///< a row without text and hash: the row is gone
};

const std::vector<Damage> kDamages = {
    {"Emptied",
     [](const Row& row, const Stores&) {
       return Row{"", row.hash};
     }},
    {"CutInHalf",
     [](const Row& row, const Stores&) {
       return Row{row.text.substr(0, row.text.size() / 2), row.hash};
     }},
    {"WithoutItsLastByte",
     [](const Row& row, const Stores&) {
       return Row{row.text.substr(0, row.text.size() - 1), row.hash};
     }},
    {"ABitOfTheHeader",
     [](const Row& row, const Stores&) {
       return Row{flipped(row.text, row.text.find("trammel_model")), row.hash};
     }},
    {"ABitOfTheBody",
     [](const Row& row, const Stores&) {
       return Row{flipped(row.text, row.text.find("spindle")), row.hash};
     }},
    {"ABitOfTheEnd",
     [](const Row& row, const Stores&) {
       return Row{flipped(row.text, row.text.size() - 1), row.hash};
     }},
    {"OfAnotherCell",
     [](const Row& row, const Stores& stores) {
       return Row{row_of(stores.path, "cell-8", 1).text, row.hash};
     }},
    {"OfAnotherVersion",
     [](const Row& row, const Stores& stores) {
       return Row{row_of(stores.path, "cell-7", 1).text, row.hash};
     }},
    {"OfAnotherStore",
     [](const Row& row, const Stores& stores) {
       return Row{row_of(stores.other, "cell-7", 1).text, row.hash};
     }},
    {"OfALaterFormat",
     [](const Row& row, const Stores&) {
       const std::string format = nlohmann::json::parse(row.text).at("trammel_model").dump();
       return Row{replaced(row.text, "\"trammel_model\":" + format, "\"trammel_model\":99"),
                  row.hash};
     }},
    {"WithAWrongHashInIt",
     [](const Row& row, const Stores&) {
       return Row{replaced(row.text, row.hash, sha256_hex("another")), row.hash};
     }},
    {"WithAnotherHashBesideIt",
     [](const Row& row, const Stores&) {
       return Row{row.text, sha256_hex("another")};
     }},
    {"WithoutAHashBesideIt",
     [](const Row& row, const Stores&) {
       return Row{row.text, ""};
     }},
    {"NoNumberInIt", [](const Row& row, const Stores&) { return with_number(row, "NaN"); }},
    {"NullInIt", [](const Row& row, const Stores&) { return with_number(row, "null"); }},
    {"ItsRowGone", [](const Row&, const Stores&) { return Row{}; }},
};

class DamagedText : public testing::TestWithParam<Damage> {
 protected:
  DamagedText() {
    put_in_force(server_.store(), "cell-7", kFirst);
    put_in_force(server_.store(), "cell-7", kInForce);
    put_in_force(server_.store(), "cell-8", kOfOthers);
    const auto other = demand(Store::open(stores_.other));
    put_in_force(*other, "cell-7", kOfOthers);
  }
  static void put_in_force(Store& store, const std::string& cell, int poses) {
    ASSERT_TRUE(
        store.add_model(cell, test::nominal_model(test::small_cell(cell), poses), 0, true, "made"));
  }
  void damage() {
    const Row row = row_of(stores_.path, "cell-7", 2);
    const Row damaged = GetParam().of(row, stores_);
    ASSERT_TRUE(damaged.text != row.text || damaged.hash != row.hash);
    const SQLite::Database file(stores_.path, SQLite::OPEN_READWRITE);
    const bool is_gone = damaged.text.empty() && damaged.hash.empty();
    SQLite::Statement change(
        file,
        is_gone ? "DELETE FROM models WHERE cell = 'cell-7' AND version = 2"
                : "UPDATE models SET content = ?, hash = ? WHERE cell = 'cell-7' AND version = 2");
    if (!is_gone) change.bind(1, damaged.text);
    if (!is_gone) change.bind(2, damaged.hash);
    ASSERT_EQ(change.exec(), 1);
  }
  CellAtStart at_start() { return demand(cells_at_start(stores_.path, cells_)).front(); }
  static void expect_said(const std::string& why, const std::string& from) {
    EXPECT_NE(why.find("version 2 is served from its copy " + from), std::string::npos) << why;
    EXPECT_NE(why.find("in the store is bad: "), std::string::npos) << why;
  }

  test::WatchedServer server_;
  const Stores stores_{server_.store_path(), server_.folder().file("other.db")};
  const ServedCells cells_ = {{"cell-7", test::small_cell("cell-7")}};
};

TEST_P(DamagedText, ItsCopyIsServedAndStatusReadinessCheckAndLogSaySo) {
  server_.take_down();
  damage();
  const std::string copies = stores_.path + ".models/";
  EXPECT_EQ(at_start().state, CellAtStart::State::kCopyServed) << at_start().why;
  expect_said(at_start().why, copies);

  server_.set_up();
  const auto logged = demand(server_.trainer().take_up());
  const Watched watched = server_.watched();
  const CellReadiness cell = cells_readiness(watched).front();
  EXPECT_STREQ(to_text(cell.state), to_text(CellReadiness::State::kCopyServed)) << cell.why;
  EXPECT_EQ(cell.version, 2);
  expect_said(cell.why, copies);
  EXPECT_TRUE(readiness(watched, ServerPhase::kServing, "").ready);
  // The status and the log say the troubles.
  EXPECT_EQ(server_.trainer().troubles(), std::vector<std::string>{cell.why});
  EXPECT_NE(std::find(logged.begin(), logged.end(), cell.why), logged.end());
  EXPECT_EQ(demand(server_.store().read("cell-7", 2)).model.provenance().training_poses, kInForce);
}

TEST_P(DamagedText, WithoutCopiesTheVersionBeforeIsServedAndThatIsSaid) {
  server_.take_down();
  damage();
  std::filesystem::remove_all(stores_.path + ".models");
  EXPECT_EQ(at_start().state, CellAtStart::State::kOlderServed);
  EXPECT_NE(at_start().why.find("version 2"), std::string::npos) << at_start().why;

  server_.set_up();
  static_cast<void>(server_.trainer().take_up());
  const Watched watched = server_.watched();
  const CellReadiness cell = cells_readiness(watched).front();
  EXPECT_STREQ(to_text(cell.state), to_text(CellReadiness::State::kOlderServed)) << cell.why;
  EXPECT_EQ(cell.version, 1);
  EXPECT_NE(cell.why.find("version 1 is served instead of a newer one"), std::string::npos)
      << cell.why;
}

INSTANTIATE_TEST_SUITE_P(Kinds, DamagedText, testing::ValuesIn(kDamages),
                         [](const auto& damage) { return std::string(damage.param.name); });

}  // namespace
}  // namespace trammel
