#pragma once

#include <optional>
#include <span>
#include <string>

#include "correlate/modes/ambient.h"
#include "correlate/modes/modal_id.h"

namespace unfurl::correlate {

/// What a record of a vibration is.
enum class Excitation {
  kByTheData,  ///< whichever of the two it shows itself to be
  kDecay,      ///< a free decay: damped sines from one beginning
  kAmbient,    ///< the response to forces that go on and that nobody measured
};
/// "auto", "decay", "ambient". Throws Error, placed at `where`, for anything else.
Excitation ParseExcitation(const std::string& text, const std::string& where);
/// The word for it.
const char* Name(Excitation excitation);

/// Modes of a record, by the method that it calls for.
struct Identification {
  Excitation excitation = Excitation::kDecay;  ///< one of the two that it was taken for
  std::string why;                             ///< how that was decided, in words
  /// Taken for a free decay that may be none, or whose modes may not be those of a structure: `why`
  /// says what speaks for that. Sines leave more than noise of a record that does not fade enough
  /// to tell, or as much as a mode; one does not fade; the later part has other modes.
  bool doubtful = false;
  ModalFit fit;                       ///< modes and poles, of either method
  std::optional<AmbientFit> ambient;  ///< of an ambient record: its doubts
};

/// A record is a free decay where damped sines from its beginning explain most of it, or leave
/// nothing but noise, or where it fades; else, if it is long enough, it is ambient.
Identification Identify(std::span<const DecaySignal> signals, Excitation excitation,
                        const ModalOptions& decay = {}, const AmbientOptions& ambient = {});

}  // namespace unfurl::correlate
