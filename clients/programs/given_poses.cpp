#include "clients/programs/given_poses.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <set>
#include <utility>

#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"

namespace trammel::cam {
namespace {

Result<bool> may_be_unused(const CsvTable& table, std::size_t row) {
  const auto column = table.find("may_be_unused");
  const std::string said = column ? table.field(row, *column) : "no";
  if (said == "yes" || said == "no") return said == "yes";
  return table.refuse(row, "may_be_unused is {}, expected yes or no", shown_short(said))
      .of("may_be_unused");
}

}  // namespace

Result<std::vector<GivenPose>> read_given_poses(const std::string& text, const std::string& where) {
  const CsvTable table = TRY(CsvTable::parse(text, where));
  const std::size_t name = TRY(table.require("name"));
  const auto columns = TRY(table.all_or_none({"x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"}));
  if (columns.empty()) return refused("no columns x_mm,y_mm,z_mm,qw,qx,qy,qz").in(where).of("x_mm");
  std::vector<GivenPose> rows;
  std::set<std::string> names;
  for (std::size_t row = 0; row < table.size(); ++row) {
    Vector3 p;
    for (std::size_t k = 0; k < 3; ++k) {
      const double value = TRY(table.number(row, columns[k], 1e6));
      p(static_cast<Eigen::Index>(k)) = from_mm(value);
    }
    const Matrix3 R = TRY(table.rotation(row, {columns.begin() + 3, columns.end()}));
    const bool spare = TRY(may_be_unused(table, row));
    rows.push_back({table.field(row, name), make_pose(R, p), table.line(row), spare});
    if (!names.insert(rows.back().name).second)
      return table.refuse(row, "{} is there twice", shown_short(rows.back().name)).of("name");
  }
  return rows;
}

Status check_used(const std::vector<GivenPose>& rows, const std::string& where,
                  const Program& program, Dialect dialect) {
  const FramesRows known = rows_of(program);
  std::vector<Error> problems;
  for (const GivenPose& row : rows) {
    const bool spelled = may_have_row(dialect, row.name);
    // The frame of an item that is left alone is not searched.
    const bool hidden = spelled && !program.left.empty() && known.open.empty();
    if (row.may_be_unused || hidden || known.used.contains(row.name)) continue;
    std::set<std::string> names = known.used;
    names.insert(known.open.begin(), known.open.end());
    problems.push_back(refused("{}: {}", shown_short(row.name),
                               spelled
                                   ? "nothing in the program uses it"
                                   : fmt::format("a {} program has no such name", name_of(dialect)))
                           .in(where)
                           .at_row(row.line)
                           .of("name")
                           .with_text(row.name)
                           .next(fmt::format("its names are: {}",
                                             shown(fmt::format("{}", fmt::join(names, ", ")))))
                           .value());
  }
  if (!problems.empty()) return tl::make_unexpected(together(std::move(problems)));
  return {};
}

}  // namespace trammel::cam
