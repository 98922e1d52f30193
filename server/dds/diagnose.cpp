#include <cmath>
#include <optional>

#include "server/dds/codec.h"
#include "server/dds/handlers.h"

namespace trammel {

Result<wire::DiagnoseReply> Handlers::answer(const wire::DiagnoseRequest& request) {
  const std::string& cell = request.about().cell();
  TRY(subjects_.cell(request.about()));
  const auto job = TRY(trainer_.diagnose(
      cell, request.batch_id(), request.csv(), false,
      ChangeId{request.change_id().to_string(),
               in_few_words("diagnose", cell, {request.batch_id(), request.csv()}),
               who(request.header())}));
  wire::DiagnoseReply reply;
  if (const auto served = registry_.in_force(cell))
    reply.model(to_wire(*served, true, unix_now_s()));
  reply.job(job);
  return reply;
}

Result<wire::CheckHealthReply> Handlers::answer(const wire::CheckHealthRequest& request) {
  const std::string& cell = request.about().cell();
  TRY(subjects_.cell(request.about()));
  std::optional<double> tolerance;
  if (!std::isnan(request.tolerance_mm())) tolerance = request.tolerance_mm();
  if (tolerance && !(*tolerance > 0 && std::isfinite(*tolerance))) {
    return failure(ErrorCode::kUsage, "a tolerance of {} mm", *tolerance)
        .of("tolerance_mm")
        .beyond(*tolerance, 0);
  }
  const auto job =
      TRY(trainer_.check(cell, request.batch_id(), request.csv(), tolerance,
                         ChangeId{request.change_id().to_string(),
                                  in_few_words("check", cell, {request.batch_id(), request.csv()}),
                                  who(request.header())}));
  wire::CheckHealthReply reply;
  if (const auto served = registry_.in_force(cell))
    reply.model(to_wire(*served, true, unix_now_s()));
  reply.job(job);
  return reply;
}

bool happens_once(const wire::DiagnoseRequest&) { return true; }
bool happens_once(const wire::CheckHealthRequest&) { return true; }

}  // namespace trammel
