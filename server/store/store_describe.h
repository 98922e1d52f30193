#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell_description.h"

/// The servers' descriptions of the cells of a record, and the choice among them.
namespace trammel {

/// A cell in one server's description.
struct CellOfServer {
  std::string server, host;
  bool is_gone = false;
  std::string differs;  ///< the part that differs from the record: `robot file`; empty: none
};

struct CellInRecord {
  std::string cell;
  CellDescription files;
  std::string server;      ///< the server whose files the record uses
  std::int64_t since = 0;  ///< Unix time, s
  std::vector<CellOfServer> servers;
};

/// Every cell with a description, by name. Refuses a place that is not a URL of PostgreSQL.
[[nodiscard]] Result<std::vector<CellInRecord>> described_cells(const std::string& url);

/// Makes the record use the files of that server, which is present or was recently. Servers with
/// other files that began with the record's former files keep their model until they restart, and
/// change nothing. Servers that began with different files do not answer for the cell. `who`: for
/// the audit trail. Refuses (kNotFound) a server or a cell that the record does not know.
[[nodiscard]] Status describe_cell(const std::string& url, const std::string& cell,
                                   const std::string& server, const std::string& who);

}  // namespace trammel
