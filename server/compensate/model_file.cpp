#include "server/compensate/model_file.h"

#include <algorithm>
#include <array>
#include <map>
#include <new>
#include <nlohmann/json.hpp>

#include "server/base/hash.h"
#include "server/base/json_guard.h"
#include "server/base/text_file.h"
#include "server/compensate/file/check_parts.h"
#include "server/compensate/file/keys.h"
#include "server/compensate/file/read_parts.h"
#include "server/compensate/file/write_parts.h"

namespace trammel {

namespace {

using Json = nlohmann::json;
using model_file::kFormat;
using Members = std::map<std::string, std::string_view>;

/// Text of a file as a message may show it: short, without control characters.
std::string shown(std::string_view text) {
  std::string plain(text.substr(0, 120));
  std::replace_if(
      plain.begin(), plain.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return plain;
}

/// Whether the outermost keys are there, and no others: a damaged key must not pass for a missing one.
Status check_keys(const Members& members, const std::string& where) {
  static constexpr std::array<std::string_view, 5> kKeys = {"content", "hash", "stamp", "trammel_model", "stamp_hash"};
  for (const auto& [key, value] : members) {
    if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end())
      return refused("not a Trammel model: unknown key {}", shown(key)).in(where).of(shown(key));
  }
  // Models from before the stamp was hashed have no stamp_hash.
  for (const std::string_view key : kKeys) {
    if (key != "stamp_hash" && !members.contains(std::string(key)))
      return refused("not a Trammel model: no {}", key).in(where).of(std::string(key));
  }
  const std::string_view format = members.at("trammel_model");
  if (format == std::to_string(kFormat)) return {};
  return refused("model format {}, this program reads {}", shown(format), kFormat)
      .in(where)
      .of("trammel_model")
      .with_text(shown(format));
}

/// Whether `by` is the hash of `of`, both as their bytes stand in the file.
Status check_hash(const Members& members, const std::string& of, const std::string& by, const std::string& where) {
  const std::string hash = sha256_hex(members.at(of));
  if (members.at(by) == '"' + hash + '"') return {};
  return refused("damaged: its {} is {}, its {} has {}", by, shown(members.at(by)), of, hash).in(where).of(by);
}

Result<CompensatedModel> checked_model(const Members& members, const std::string& where) {
  Status fine = check_keys(members, where);
  if (fine) fine = check_hash(members, "content", "hash", where);
  if (fine && members.contains("stamp_hash")) fine = check_hash(members, "stamp", "stamp_hash", where);
  if (!fine) return tl::make_unexpected(fine.error());
  Result<ModelParts> parts =
      model_file::parts_from(Json::parse(members.at("content")), Json::parse(members.at("stamp")), where);
  if (!parts) return tl::make_unexpected(parts.error());
  const Status possible = model_file::check_parts(*parts);
  Result<CompensatedModel> model =
      possible ? CompensatedModel::make(std::move(*parts)) : tl::make_unexpected(possible.error());
  return std::move(model).map_error([&](Error error) { return Failure(std::move(error)).in(where).value(); });
}

}  // namespace

std::string serialize(const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  const Json stamp = model_file::stamp_of(provenance);
  const Json file = {{"trammel_model", kFormat},
                     {"hash", provenance.hash},
                     {"stamp", stamp},
                     {"stamp_hash", sha256_hex(stamp.dump())},
                     {"content", model_file::content_of(model.parts())}};
  // The last byte closes the object, so a text that was cut off is no longer one.
  return file.dump();
}

Result<CompensatedModel> deserialize(const std::string& text, const std::string& where) {
  try {
    return json_members(text, where).and_then([&](const Members& members) { return checked_model(members, where); });
  } catch (const Json::exception& error) {
    return refused("not a Trammel model: {}", shown(error.what())).in(where);
  } catch (const std::bad_alloc&) {
    return failure(ErrorCode::kTooLarge, "its {} bytes ask for more memory than there is", text.size())
        .in(where)
        .with_value(text.size());
  }
}

Result<CompensatedModel> load_model(const std::string& path) {
  return read_text_file(path).and_then([&](const std::string& text) { return deserialize(text, path); });
}

}  // namespace trammel
