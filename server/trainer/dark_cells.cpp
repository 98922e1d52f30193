#include "server/trainer/dark_cells.h"

#include "server/store/served_models.h"
#include "server/tasks/accept/fits_cell.h"

namespace trammel {
namespace {

using State = CellAtStart::State;

Result<CellAtStart> look_at(const ServedModels& models, const std::string& name, const Cell& cell) {
  CellAtStart one{name, State::kDark};
  bool fits_not = false;
  TRY(models.find(name, [&](const ModelOnDisk& on_disk) {
    const std::string where = fmt::format("version {} of cell {}", on_disk.version, name);
    const auto read = read_model(on_disk, where);
    Status good = read ? check_fits_cell(read->model, cell, where)
                       : Status(tl::make_unexpected(read.error()));
    fits_not = read && !good;
    if (one.version == 0) one.version = on_disk.version;
    if (good && !one.why.empty()) {
      one.state = State::kOlderServed;
    } else if (good) {
      one.state = read->damage.empty() ? State::kServed : State::kCopyServed;
      one.why = read->damage;
    } else if (one.why.empty()) {
      one.why = sentence(good.error());
    }
    return good || fits_not;  // if a model does not fit, no other version replaces it
  }));
  if (one.version == 0) one.state = State::kUntrained;  // nothing was ever in force
  return one;
}

}  // namespace

Result<std::vector<CellAtStart>> cells_at_start(const std::string& path, const ServedCells& cells) {
  const auto models = TRY(ServedModels::open(path));
  std::vector<CellAtStart> all;
  for (const auto& [name, cell] : cells) {
    auto one = TRY(look_at(models, name, *cell));
    all.push_back(std::move(one));
  }
  return all;
}

}  // namespace trammel
