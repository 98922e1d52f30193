#include <algorithm>

#include "server/store/audit_rows.h"
#include "server/store/cell_rows.h"
#include "server/store/connection.h"
#include "server/store/server_rows.h"
#include "server/store/store.h"

// Compares the descriptions of a cell by the servers of a record, each of which has the cell's
// files on its own host.

namespace trammel {
namespace {

using Mine = std::map<std::string, CellDescription>;
using Disputes = std::map<std::string, std::string>;

constexpr const char* kNewest =
    "SELECT cell, cell_hash, robot_hash, server, described_at FROM cell_descriptions WHERE number "
    "IN (SELECT MAX(number) FROM cell_descriptions WHERE $1 = '' OR cell = $1 GROUP BY cell)";

/// The others that are there and have this cell.
std::vector<const ServerInRecord*> who_has(const std::vector<ServerInRecord>& others,
                                           const std::string& cell) {
  std::vector<const ServerInRecord*> having;
  for (const ServerInRecord& one : others)
    if (!one.is_gone && one.self.cells.contains(cell)) having.push_back(&one);
  return having;
}

bool describes_so(const ServerInRecord& server, const std::string& cell,
                  const CellDescription& files) {
  return server.self.cells.at(cell).files == files;
}

/// The reason why the server does not answer for the cell, or changes nothing of it. `was_so`: its
/// files were the record's since it began.
std::string why_not(const std::string& cell, const std::string& me, const DescribedCell& known,
                    const CellDescription& mine, const std::vector<const ServerInRecord*>& having,
                    bool was_so) {
  const auto holder = std::find_if(having.begin(), having.end(), [&](const ServerInRecord* one) {
    return describes_so(*one, cell, known.files);
  });
  const std::string whose =
      holder != having.end()
          ? fmt::format("than {} (on {})", (*holder)->self.server, (*holder)->self.host)
          : fmt::format("than {} had", known.server == me ? "it" : known.server);
  const std::string has = fmt::format("cell {}: {} has another {} {}, by which the record goes",
                                      cell, me, what_differs(known.files, mine), whose);
  if (was_so)
    return fmt::format(
        "{} now: until it is started with the same one, {} answers with the model that it has, and "
        "changes nothing",
        has, me);
  return fmt::format(
      "{}: {} does not serve it until they agree (trammel store describe says whose counts)", has,
      me);
}

/// Compares this server's descriptions of cells with the record's.
class Comparison {
 public:
  Comparison(Database& database, const Worker& worker, bool starts,
             const std::set<std::string>& agreed)
      : database_(database),
        worker_(worker),
        starts_(starts),
        agreed_(agreed),
        others_(server_rows(database, true, worker.token)) {}

  void compare(const std::string& cell, const CellDescription& mine) {
    lock_cell(database_, cell);
    const auto known = cell_description(database_, cell);
    if (known && known->files == mine) return;
    const bool was_so = agreed_.contains(cell);  // servers that still have an abandoned description
                                                 // do not bring it back
    if (known && (was_so || !may_change(cell, *known, mine))) {
      disputes_[cell] = why_not(cell, worker_.server, *known, mine, who_has(others_, cell), was_so);
      return;
    }
    add_cell_description(database_, cell, mine, worker_.server);
    if (known) {
      record_audit(database_, {cell, "describe", "description", spoken(known->files, known->server),
                               spoken(mine, worker_.server)});
    } else {
      first_.push_back(cell);
    }
  }

  Disputes end() {
    if (!first_.empty())
      record_audit(
          database_,
          {first_.size() == 1 ? first_.front() : "", "describe", "description", "",
           fmt::format("{} cell{} as {} has {}", first_.size(), first_.size() == 1 ? "" : "s",
                       worker_.server, first_.size() == 1 ? "it" : "them")});
    return std::move(disputes_);
  }

 private:
  [[nodiscard]] bool may_change(const std::string& cell, const DescribedCell& known,
                                const CellDescription& mine) const {
    const auto having = who_has(others_, cell);
    if (having.empty()) return starts_ && known.server == worker_.server;
    const auto wants = std::count_if(having.begin(), having.end(), [&](const ServerInRecord* one) {
      return describes_so(*one, cell, mine) && one->self.cells.at(cell).is_apart;
    });
    const auto others = std::count_if(having.begin(), having.end(), [&](const ServerInRecord* one) {
      return !describes_so(*one, cell, mine);
    });
    return wants > 0 && wants + 1 > others;
  }

  Database& database_;
  const Worker& worker_;
  const bool starts_;
  const std::set<std::string>& agreed_;
  const std::vector<ServerInRecord> others_;
  std::vector<std::string> first_;
  Disputes disputes_;
};

}  // namespace

std::map<std::string, DescribedCell> cell_descriptions(Database& database) {
  std::map<std::string, DescribedCell> all;
  auto rows = prepare(database, kNewest, "");
  while (rows.next())
    all[rows.text(0)] = {{rows.text(1), rows.text(2)}, rows.text(3), rows.integer64(4)};
  return all;
}

std::optional<DescribedCell> cell_description(Database& database, const std::string& cell) {
  auto row = prepare(database, kNewest, cell);
  if (!row.next()) return std::nullopt;
  return DescribedCell{{row.text(1), row.text(2)}, row.text(3), row.integer64(4)};
}

void add_cell_description(Database& database, const std::string& cell, const CellDescription& files,
                          const std::string& server) {
  change(database,
         "INSERT INTO cell_descriptions (cell, cell_hash, robot_hash, server, described_at) VALUES "
         "($1, $2, $3, $4, $5)",
         cell, files.cell, files.robot, server, now_of(database));
}

std::string spoken(const CellDescription& files, const std::string& server) {
  return fmt::format("as {} has it: cell file {}, robot file {}", server, files.cell, files.robot);
}

Result<std::int64_t> Store::descriptions_made() const {
  if (!is_shared()) return 0;
  return connection_->exclusively([](Database& database) -> Result<std::int64_t> {
    return integer_of(database, "SELECT COALESCE(MAX(number), 0) FROM cell_descriptions");
  });
}

Result<RecordCounts> Store::counts() const {
  return connection_->exclusively([](Database& database) -> Result<RecordCounts> {
    auto row = prepare(database,
                       "SELECT (SELECT rows FROM audit_end), (SELECT COALESCE(MAX(number), 0) FROM "
                       "cell_descriptions)");
    if (!row.next()) return RecordCounts{};
    return RecordCounts{row.integer64(0), row.integer64(1)};
  });
}

Result<Disputes> Store::agree_on_cells(const Mine& mine, bool starts,
                                       const std::set<std::string>& agreed) {
  if (!is_shared()) return Disputes();
  const auto differing = TRY(connection_->exclusively([&](Database& database) -> Result<Mine> {
    Mine all;
    const auto known = cell_descriptions(database);
    for (const auto& [cell, files] : mine) {
      const auto found = known.find(cell);
      if (found == known.end() || found->second.files != files) all.emplace(cell, files);
    }
    return all;
  }));
  if (differing.empty()) return Disputes();
  return connection_->in_transaction([&](Database& database) -> Result<Disputes> {
    Comparison comparison(database, connection_->worker, starts, agreed);
    for (const auto& [cell, files] : differing) comparison.compare(cell, files);
    return comparison.end();
  });
}

}  // namespace trammel
