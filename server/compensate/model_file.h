#pragma once

#include <string>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"

/// A model as a file; MODEL_FILE.md describes its contents.
namespace trammel {

/// The model as text: JSON, one object. Same data, same seed, same content, same hash, same id.
[[nodiscard]] std::string serialize(const CompensatedModel& model);
/// The strictness towards the names, sentences and times of a model, which change no answer.
enum class ModelTexts {
  kChecked,   ///< of a file from outside: see check_texts()
  kAsTheyAre  ///< for a model that was accepted before: it stays valid, and code that shows its
              ///< texts cleans them
};
/// The model in `text`; `where` names the file in messages. Refuses a text that is not a model, a
/// hash that does not fit the content, and numbers or texts that no model can have.
[[nodiscard]] Result<CompensatedModel> deserialize(const std::string& text,
                                                   const std::string& where,
                                                   ModelTexts texts = ModelTexts::kChecked);
[[nodiscard]] Result<CompensatedModel> load_model(const std::string& path);
/// The hash of a model's content. Refuses a text with a changed byte, by the text's own hashes.
/// Cheap, since it does not build a model.
[[nodiscard]] Result<std::string> undamaged_hash(const std::string& text, const std::string& where);

}  // namespace trammel
