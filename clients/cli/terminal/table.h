#pragma once

#include <string>
#include <vector>

namespace trammel::cli {

/// A column of a table for people.
struct TableColumn {
  std::string name;
  bool is_right = false;  ///< numbers stand at the right
  bool is_wide = false;   ///< shown with `-o wide` alone
};

/// `table`: at most 100 columns of text, with the last column wrapped. `wide`: everything, one line
/// per row.
enum class TableForm { kTable, kWide };

/// Rows under their headings, each column as wide as it needs. Every row has a cell for each
/// column.
[[nodiscard]] std::string table_text(const std::vector<TableColumn>& columns,
                                     const std::vector<std::vector<std::string>>& rows,
                                     TableForm form);

}  // namespace trammel::cli
