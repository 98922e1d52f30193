#include "clients/cli/service/model_answers.h"

#include <filesystem>

namespace trammel::cli {

Result<CompensatedModel> model_named(const std::string& name, const ServiceOptions& service) {
  std::error_code error;
  if (!service.service || std::filesystem::exists(name, error)) return load_model(name);
  const ModelReference reference = TRY(parse_model_reference(name));
  const auto session = TRY(open_session(service));
  const std::string text = TRY(session->export_model(reference.cell, reference.version));
  return deserialize(text, "the service's model " + name);
}

}  // namespace trammel::cli
