#include "server/measurement/reading/number_table.h"

#include <algorithm>
#include <map>
#include <string>

namespace trammel::reading {

NumberTable table_of(const MeasurementBatch& batch) {
  const auto& measurements = batch.measurements;
  const auto n = static_cast<Eigen::Index>(measurements.size());
  NumberTable table;
  if (measurements.empty()) return table;
  table.q.resize(measurements.front().context.q.size(), n);
  table.p_W.resize(3, n);
  for (const Measurement& m : measurements) {
    const auto i = static_cast<Eigen::Index>(table.from.size());
    table.q.col(i) = m.context.q;
    table.p_W.col(i) = m.p_W;
    table.R_WT.push_back(m.R_WT);
    table.from.push_back(&m);
  }
  return table;
}

NumberTable matched(const NumberTable& table, const std::vector<std::size_t>& rows,
                    const std::vector<std::size_t>& joints_of) {
  NumberTable some;
  some.q.resize(table.q.rows(), static_cast<Eigen::Index>(rows.size()));
  some.p_W.resize(3, static_cast<Eigen::Index>(rows.size()));
  for (std::size_t k = 0; k < rows.size(); ++k) {
    some.q.col(static_cast<Eigen::Index>(k)) = table.joints(joints_of[k]);
    some.p_W.col(static_cast<Eigen::Index>(k)) = table.position(rows[k]);
    some.R_WT.push_back(table.R_WT[rows[k]]);
    some.from.push_back(table.from[rows[k]]);
  }
  return some;
}

NumberTable thinned(const NumberTable& table, std::size_t most) {
  if (table.size() <= most) return table;
  std::map<std::string, std::vector<std::size_t>> by_tool;
  for (std::size_t i = 0; i < table.size(); ++i) by_tool[table.from[i]->context.tool].push_back(i);
  const std::size_t fewest = std::max<std::size_t>(1, most / (2 * by_tool.size()));
  std::vector<std::size_t> rows;
  for (const auto& [tool, of_tool] : by_tool) {
    const std::size_t n = of_tool.size();
    const std::size_t kept = std::min(n, std::max(fewest, most * n / table.size()));
    for (std::size_t k = 0; k < kept; ++k) rows.push_back(of_tool[k * n / kept]);
  }
  std::sort(rows.begin(), rows.end());
  return matched(table, rows, rows);
}

}  // namespace trammel::reading
