#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell_description.h"

/// The descriptions that the servers of a record have of its cells, and by whose description it
/// goes.
namespace trammel {

/// A cell as one server has it.
struct CellOfServer {
  std::string server, host;
  bool is_gone = false;
  std::string differs;  ///< `robot file`: in what from the record; empty: in nothing
};

struct CellInRecord {
  std::string cell;
  CellDescription files;
  std::string server;      ///< by whose files the record goes
  std::int64_t since = 0;  ///< Unix time, s
  std::vector<CellOfServer> servers;
};

/// Every cell that has a description, by name. Refuses what is no URL of PostgreSQL.
[[nodiscard]] Result<std::vector<CellInRecord>> described_cells(const std::string& url);

/// From now on the record goes by the files of that server, which is there or was lately. Who has
/// others and began with what was the record's goes on with the model that it has until it is
/// started again, and changes nothing; who began otherwise does not answer for the cell. `who`: for
/// the audit trail. Refuses (kNotFound) a server or a cell that the record does not know.
[[nodiscard]] Status describe_cell(const std::string& url, const std::string& cell,
                                   const std::string& server, const std::string& who);

}  // namespace trammel
