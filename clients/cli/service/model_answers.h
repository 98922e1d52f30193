#pragma once

#include <functional>
#include <string>

#include "clients/cli/service/answers.h"
#include "clients/cli/terminal/options.h"
#include "clients/programs/model_tools.h"
#include "server/compensate/compensated_model.h"
#include "server/compensate/model_file.h"

/// A model's answers for programs, from a file or from a service.
namespace trammel::cli {

using cam::info_of;
using cam::known_tool_and_payload;
using cam::ToolAndPayload;
using cam::tools_of;

/// The model of a file. With --service, if no file has that name, it is the service's model: of
/// `cell@version`, or the model in force of a cell.
[[nodiscard]] Result<CompensatedModel> model_named(const std::string& name,
                                                   const ServiceOptions& service);

/// Tells which model answered a call.
using SawModel = std::function<void(const exchange::ModelInfo&)>;

/// Calls `work(session, context, model, saw)` with the model that the service uses. The model is
/// fetched, and fetched again if another one answered meanwhile. kBusy: this happened repeatedly.
template <typename T, typename Work>
[[nodiscard]] Result<T> with_served_model(const std::string& name, const ServiceOptions& service,
                                          const Work& work) {
  constexpr int kAttempts = 5;
  const Result<ModelReference> reference = parse_model_reference(name);
  if (!reference) return tl::make_unexpected(reference.error());
  const auto session = open_session(service);
  if (!session) return tl::make_unexpected(session.error());
  client::CallContext context;
  context.cell = reference->cell;
  if (reference->version > 0) context.model = fmt::format("@{}", reference->version);
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const Result<std::string> text = (*session)->export_model(reference->cell, reference->version);
    if (!text) return tl::make_unexpected(text.error());
    const Result<CompensatedModel> model = deserialize(*text, name);
    if (!model) return tl::make_unexpected(model.error());
    bool another = false;
    const SawModel saw = [&](const exchange::ModelInfo& answered) {
      another |= answered.hash != model->provenance().hash;
    };
    Result<T> done = work(**session, context, *model, saw);
    if (!another) return done;
  }
  return failure(ErrorCode::kBusy, "cell {}: the model changed during each of {} attempts",
                 reference->cell, kAttempts);
}

}  // namespace trammel::cli
