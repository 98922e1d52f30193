#include "server/store/store_describe.h"

#include <type_traits>

#include "server/store/audit_rows.h"
#include "server/store/cell_rows.h"
#include "server/store/open_to_read.h"
#include "server/store/server_rows.h"
#include "server/store/store_place.h"

namespace trammel {
namespace {

/// Runs `work` in one transaction.
template <typename Work>
std::invoke_result_t<const Work&, Database&> in_record(const std::string& url,
                                                       Transaction::For what, const Work& work) {
  if (!is_postgres_url(url))
    return refused("is no URL of PostgreSQL")
        .in(url)
        .next("a file has one server, whose files count");
  return work_at(url, open_to_write, [&](Database& database) {
    Transaction transaction(database, what);
    auto done = work(database);
    if (done) transaction.commit();
    return done;
  });
}

/// The newest start of the server that has the cell.
const ServerInRecord* find_server(const std::vector<ServerInRecord>& servers,
                                  const std::string& server, const std::string& cell) {
  const ServerInRecord* found = nullptr;
  for (const ServerInRecord& one : servers) {
    if (one.self.server != server || !one.self.cells.contains(cell)) continue;
    if (found == nullptr || found->heard_at < one.heard_at) found = &one;
  }
  return found;
}

}  // namespace

Result<std::vector<CellInRecord>> described_cells(const std::string& url) {
  return in_record(
      url, Transaction::For::kReading, [](Database& database) -> Result<std::vector<CellInRecord>> {
        const std::vector<ServerInRecord> servers = server_rows(database, true);
        std::vector<CellInRecord> cells;
        for (const auto& [cell, known] : cell_descriptions(database)) {
          CellInRecord& one =
              cells.emplace_back(CellInRecord{cell, known.files, known.server, known.at, {}});
          for (const ServerInRecord& server : servers) {
            const auto has = server.self.cells.find(cell);
            if (has == server.self.cells.end()) continue;
            one.servers.push_back({server.self.server, server.self.host, server.is_gone,
                                   what_differs(known.files, has->second.files)});
          }
        }
        return cells;
      });
}

Status describe_cell(const std::string& url, const std::string& cell, const std::string& server,
                     const std::string& who) {
  return in_record(url, Transaction::For::kWriting, [&](Database& database) -> Status {
    lock_cell(database, cell);
    const auto known = cell_description(database, cell);
    if (!known)
      return failure(ErrorCode::kNotFound, "no server has told of cell {}", cell)
          .of("cell")
          .with_text(cell);
    const std::vector<ServerInRecord> servers = server_rows(database, true);
    const ServerInRecord* wanted = find_server(servers, server, cell);
    if (wanted == nullptr)
      return failure(ErrorCode::kNotFound, "no server {} with cell {} is there", server, cell)
          .of("server")
          .with_text(server)
          .next("trammel store describe lists them");
    const CellDescription& files = wanted->self.cells.at(cell).files;
    if (files == known->files) return {};
    add_cell_description(database, cell, files, server);
    ChangeId by;
    by.who = who;
    record_audit(database,
                 {cell, "describe", "description", spoken(known->files, known->server),
                  spoken(files, server)},
                 by);
    return {};
  });
}

}  // namespace trammel
