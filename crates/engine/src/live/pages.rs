//! The open pages of a run: which of them the end of the program waits for.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

/// A page that has not sent a request for this long counts as closed.
const CLOSED_AFTER: Duration = Duration::from_secs(3);
/// A page that was sent to a browser has this long for its first request: a large page on a busy machine takes seconds.
const LOAD_TIMEOUT: Duration = Duration::from_secs(5);
/// Maximum number of known pages, and of pages that were sent and have not sent a request.
const PAGES: usize = 32;

/// The pages that have sent a request, and those that were sent to a browser and have not yet done so.
#[derive(Default)]
pub(super) struct Pages {
    known: BTreeMap<String, Page>,
    /// The oldest first.
    sent: VecDeque<Sent>,
}

/// A page that has sent a request.
struct Page {
    seen: Instant,
    has_result: bool,
}

/// A page that was sent to a browser: the report, or one that only asks for it again a second later.
struct Sent {
    at: Instant,
    asks_again: bool,
}

impl Pages {
    /// A browser is sent a page at `now`: one that asks for the report again, or the report itself.
    pub(super) fn page_sent(&mut self, asks_again: bool, now: Instant) {
        // The browser that asks may be one whose page asks again.
        self.remove_sent(true);
        self.sent.push_back(Sent { at: now, asks_again });
        if self.sent.len() > PAGES {
            self.sent.pop_front();
        }
    }

    /// The page `id` has sent a request.
    pub(super) fn request_received(&mut self, id: &str, now: Instant) {
        self.known.retain(|_, page| is_within(page.seen, now, CLOSED_AFTER));
        if let Some(page) = self.known.get_mut(id) {
            page.seen = now;
            return;
        }
        self.remove_sent(false);
        if self.known.len() < PAGES {
            let page = Page {
                seen: now,
                has_result: false,
            };
            self.known.insert(id.to_owned(), page);
        }
    }

    fn remove_sent(&mut self, asks_again: bool) {
        if let Some(at) = self.sent.iter().position(|one| one.asks_again == asks_again) {
            self.sent.remove(at);
        }
    }

    /// The page `id` has received the result.
    pub(super) fn serve_result(&mut self, id: &str) {
        if let Some(page) = self.known.get_mut(id) {
            page.has_result = true;
        }
    }

    /// Whether there is a page that has not received the result and may still ask for it.
    pub(super) fn has_pending(&self, now: Instant) -> bool {
        let known = |page: &Page| !page.has_result && is_within(page.seen, now, CLOSED_AFTER);
        self.known.values().any(known) || self.sent.iter().any(|one| is_within(one.at, now, LOAD_TIMEOUT))
    }
}

fn is_within(since: Instant, now: Instant, limit: Duration) -> bool {
    now.saturating_duration_since(since) < limit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_is_pending_from_sending_until_it_has_the_result() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut pages = Pages::default();
        assert!(!pages.has_pending(at(0)));
        // The run has not begun: the page asks again a second later, and receives the report.
        pages.page_sent(true, at(0));
        assert!(pages.has_pending(at(900)));
        pages.page_sent(false, at(1000));
        assert!(pages.has_pending(at(1500)));
        pages.request_received("a", at(2000));
        pages.request_received("a", at(2200));
        assert!(pages.has_pending(at(2300)));
        pages.serve_result("a");
        assert!(!pages.has_pending(at(2300)), "no other page was sent");
    }

    #[test]
    fn silent_page_is_no_longer_pending() {
        let start = Instant::now();
        let mut pages = Pages::default();
        (0..100).for_each(|_| pages.page_sent(false, start));
        assert!(pages.has_pending(start + LOAD_TIMEOUT / 2));
        assert!(!pages.has_pending(start + LOAD_TIMEOUT));
        pages.request_received("closed", start);
        assert!(!pages.has_pending(start + LOAD_TIMEOUT.max(CLOSED_AFTER)));
    }

    #[test]
    fn each_of_several_pages_is_pending_without_the_result() {
        let start = Instant::now();
        let mut pages = Pages::default();
        pages.page_sent(false, start);
        pages.page_sent(false, start);
        pages.request_received("a", start);
        pages.serve_result("a");
        assert!(pages.has_pending(start), "the other one is still loading");
        pages.request_received("b", start);
        assert!(pages.has_pending(start));
        pages.serve_result("b");
        assert!(!pages.has_pending(start));
    }
}
