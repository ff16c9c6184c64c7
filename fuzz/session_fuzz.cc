// Any bytes go for a session.json and for a journal. The text of a session that was read gives the
// same session again, and the whole lines of a journal the same journal.
#include "fuzz/target.h"
#include "scanner/capture/journal.h"
#include "scanner/sessions/session.h"

namespace sateen::fuzz {
namespace {

void SessionOf(std::string_view bytes) {
  FileOf("session.json", bytes);
  const auto session = ReadSessionRecord(Folder());
  if (session) {
    const std::string text = SessionToJson(*session);
    FileOf("session.json", text);
    const auto again = ReadSessionRecord(Folder());
    Need(again && SessionToJson(*again) == text);
  }
}

void JournalOf(const std::string& text) {
  const auto journal = ParseJournal(text, "journal");
  if (!journal || !*journal) {
    return;
  }
  const Journal& read = **journal;
  Need(read.whole_bytes <= text.size() && read.done.size() == read.plan.size());
  const auto again = ParseJournal(text.substr(0, read.whole_bytes), "journal");
  Need(again && *again && (*again)->whole_bytes == read.whole_bytes &&
       (*again)->plan.size() == read.plan.size() && (*again)->complete == read.complete);
}

}  // namespace

void Try(std::string_view bytes) {
  SessionOf(bytes);
  JournalOf(std::string(bytes));
}

}  // namespace sateen::fuzz
