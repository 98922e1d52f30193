#include "server/http/refusal.h"

#include "server/report/error_json.h"

namespace trammel {

HttpReply refusal(int code, const Error& error) {
  return {code, "application/json", json_text({{"error", error_json(error)}})};
}

}  // namespace trammel
