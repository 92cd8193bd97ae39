//! The open pages of a run: which of them the end of the program waits for.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

/// A page that has not sent a request for this long counts as closed.
const ABSENT: Duration = Duration::from_secs(3);
/// A page that was sent to a browser has this long for its first request: a large page on a busy machine takes seconds.
const LOADS: Duration = Duration::from_secs(5);
/// Maximum number of known pages, and of pages that were sent and have not been heard of.
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
    pub(super) fn send(&mut self, asks_again: bool, now: Instant) {
        // The browser that asks may be one that was told to ask again.
        self.arrives(true);
        self.sent.push_back(Sent { at: now, asks_again });
        if self.sent.len() > PAGES {
            self.sent.pop_front();
        }
    }

    /// The page `id` has sent a request.
    pub(super) fn hear(&mut self, id: &str, now: Instant) {
        self.known.retain(|_, page| is_within(page.seen, now, ABSENT));
        if let Some(page) = self.known.get_mut(id) {
            page.seen = now;
            return;
        }
        self.arrives(false);
        if self.known.len() < PAGES {
            let page = Page {
                seen: now,
                has_result: false,
            };
            self.known.insert(id.to_owned(), page);
        }
    }

    fn arrives(&mut self, asks_again: bool) {
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
    pub(super) fn wait(&self, now: Instant) -> bool {
        let known = |page: &Page| !page.has_result && is_within(page.seen, now, ABSENT);
        self.known.values().any(known) || self.sent.iter().any(|one| is_within(one.at, now, LOADS))
    }
}

fn is_within(since: Instant, now: Instant, limit: Duration) -> bool {
    now.saturating_duration_since(since) < limit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_waited_for_from_the_moment_it_is_sent_until_it_has_the_result() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut pages = Pages::default();
        assert!(!pages.wait(at(0)));
        // The run has not begun: the page asks again a second later, and receives the report.
        pages.send(true, at(0));
        assert!(pages.wait(at(900)));
        pages.send(false, at(1000));
        assert!(pages.wait(at(1500)));
        pages.hear("a", at(2000));
        pages.hear("a", at(2200));
        assert!(pages.wait(at(2300)));
        pages.serve_result("a");
        assert!(!pages.wait(at(2300)), "no other page was sent");
    }

    #[test]
    fn a_page_that_is_not_heard_of_is_given_up() {
        let start = Instant::now();
        let mut pages = Pages::default();
        (0..100).for_each(|_| pages.send(false, start));
        assert!(pages.wait(start + LOADS / 2));
        assert!(!pages.wait(start + LOADS));
        pages.hear("closed", start);
        assert!(!pages.wait(start + LOADS.max(ABSENT)));
    }

    #[test]
    fn every_one_of_several_pages_is_waited_for() {
        let start = Instant::now();
        let mut pages = Pages::default();
        pages.send(false, start);
        pages.send(false, start);
        pages.hear("a", start);
        pages.serve_result("a");
        assert!(pages.wait(start), "the other one is still loading");
        pages.hear("b", start);
        assert!(pages.wait(start));
        pages.serve_result("b");
        assert!(!pages.wait(start));
    }
}
