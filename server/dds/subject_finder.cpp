#include <algorithm>
#include <charconv>
#include <optional>

#include "server/dds/handlers.h"

namespace trammel {
namespace {

constexpr std::size_t kVersionsInMemory = 4;

/// The version in `@3`.
std::optional<int> version_number(const std::string& model) {
  if (model.size() < 2 || model.front() != '@') return std::nullopt;
  int version = 0;
  const char* end = model.data() + model.size();
  const auto [stopped, error] = std::from_chars(model.data() + 1, end, version);
  if (error != std::errc() || stopped != end || version < 1) return std::nullopt;
  return version;
}

}  // namespace

Result<std::shared_ptr<const Cell>> SubjectFinder::cell(const wire::Context& context) const {
  const ServedCells& cells = trainer_.cells();
  const auto found = cells.find(context.cell());
  if (found == cells.end()) {
    return failure(ErrorCode::kNotFound, "cell `{}` is not served here", context.cell())
        .of("cell")
        .with_text(context.cell());
  }
  if (context.controller_compensates()) {
    return refused(
               "cell {}: models are trained with a controller that does not compensate, this one "
               "does",
               context.cell())
        .of("controller_compensates");
  }
  const Cell& cell = *found->second;
  if (!context.tool().empty() && !cell.tools.contains(context.tool())) {
    return refused("cell {}: unknown tool `{}`", context.cell(), context.tool())
        .of("tool")
        .with_text(context.tool());
  }
  if (!context.payload().empty() && !cell.payloads.contains(context.payload())) {
    return refused("cell {}: unknown payload `{}`", context.cell(), context.payload())
        .of("payload")
        .with_text(context.payload());
  }
  return found->second;
}

Result<Subject> SubjectFinder::find(const wire::Context& context) {
  TRY(cell(context));
  if (const auto why = trainer_.why_apart(context.cell()))
    return failure(ErrorCode::kConflict, "{}", *why).of("cell").with_text(context.cell());
  const auto [in_force, comes] = registry_.ready(context.cell());
  if (comes) {  // a worker of the service does not wait for the disk
    return failure(ErrorCode::kBusy, "the model of cell {} is being loaded", context.cell())
        .of("cell")
        .with_text(context.cell())
        .next("try again in a second");
  }
  Subject subject{in_force, true, {}, {}};
  if (const auto wanted = version_number(context.model());
      wanted && (!in_force || in_force->version != *wanted)) {
    auto stored = TRY(version(context.cell(), *wanted));
    subject.served = std::move(stored);
    subject.in_force = false;
  } else if (!in_force) {
    return failure(ErrorCode::kNotFound, "cell {} has no model in force", context.cell())
        .of("cell")
        .with_text(context.cell());
  } else if (!wanted && !context.model().empty() &&
             context.model() != in_force->model.provenance().id &&
             context.model() != in_force->model.provenance().hash) {
    return failure(ErrorCode::kConflict, "cell {}: model `{}` is not in force, {} (version {}) is",
                   context.cell(), context.model(), in_force->model.provenance().id,
                   in_force->version)
        .of("model")
        .with_text(context.model());
  }

  const Cell& trained_for = subject.served->model.cell();
  const auto tool = TRY(resolve_tool(trained_for, context.tool()));
  const auto payload = TRY(resolve_payload(trained_for, context.payload()));
  TRY(subject.served->model.check_trained_with(tool, payload));
  subject.tool = tool;
  subject.payload = payload;
  return subject;
}

Result<std::shared_ptr<const ServedModel>> SubjectFinder::version(const std::string& cell,
                                                                  int version) {
  {
    const MutexLock lock(mutex_);
    const auto found = std::find_if(loaded_.begin(), loaded_.end(), [&](const auto& m) {
      return m->cell == cell && m->version == version;
    });
    if (found != loaded_.end()) return *found;
  }
  // Without the lock: other requests do not wait while a model is read.
  auto model = TRY(trainer_.load_for_service(cell, version));
  auto served = std::make_shared<const ServedModel>(ServedModel{cell, version, std::move(model)});
  const MutexLock lock(mutex_);
  loaded_.push_front(served);
  if (loaded_.size() > kVersionsInMemory) loaded_.pop_back();
  return served;
}

}  // namespace trammel
