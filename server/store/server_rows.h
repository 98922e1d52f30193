#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/store/database/database.h"
#include "server/store/servers.h"

/// Servers, and descriptions of cells, as rows.
namespace trammel {

/// The present servers, and those that disappeared without notice, by name. `but`: the token of a
/// server to leave out.
[[nodiscard]] std::vector<ServerInRecord> server_rows(Database& database, bool with_cells,
                                                      const std::string& but = {});

/// The description of a cell that the record uses.
struct DescribedCell {
  CellDescription files;
  std::string server;   ///< the server of the description
  std::int64_t at = 0;  ///< Unix time, s, by the database's clock
};
[[nodiscard]] std::map<std::string, DescribedCell> cell_descriptions(Database& database);
[[nodiscard]] std::optional<DescribedCell> cell_description(Database& database,
                                                            const std::string& cell);
void add_cell_description(Database& database, const std::string& cell, const CellDescription& files,
                          const std::string& server);
/// The description in the words of the audit trail.
[[nodiscard]] std::string spoken(const CellDescription& files, const std::string& server);

}  // namespace trammel
