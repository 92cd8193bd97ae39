//! Inputs that are assembled from fields: which of their elements are fed, and by which link.

use std::collections::HashSet;

use super::{Plan, PlanError};
use crate::port::{Descriptor, Field};

/// The source of an element: a link, and whether it is added to those of other links.
type ElementSource = Option<(usize, bool)>;

/// Elements that are fed twice, and elements of required inputs that are not fed. Which elements of an input a `rejected` link would feed
/// is not known.
pub(super) fn check_coverage(plan: &Plan, rejected: &HashSet<(usize, usize)>) -> Vec<PlanError> {
    let mut errors = Vec::new();
    for (number, participant) in plan.participants.iter().enumerate() {
        for (input, links) in participant.inputs.iter().enumerate() {
            if links.iter().any(|&link| plan.links[link].conversion.is_some()) {
                let port = &participant.interface.inputs[input];
                let mut fed = vec![None; port.descriptor.size as usize];
                for &link in links {
                    errors.extend(register_sources(plan, link, &port.descriptor, &mut fed));
                }
                let unfed = unfed_elements(&port.descriptor, &fed);
                if port.required && !unfed.is_empty() && !rejected.contains(&(number, input)) {
                    errors.push(PlanError::FieldsNotFed {
                        input: plan.input_name((number, input)),
                        fields: unfed,
                    });
                }
            }
        }
    }
    errors
}

/// Registers the elements that `link` feeds; returns an error for the first one that is fed already, unless both links add.
fn register_sources(plan: &Plan, link: usize, descriptor: &Descriptor, fed: &mut [ElementSource]) -> Option<PlanError> {
    let own = &plan.links[link];
    for pair in own.conversion.iter().flat_map(|conversion| &conversion.pairs) {
        for at in pair.range().step_by(pair.to.element.size()) {
            match fed[at] {
                Some((first, adds)) if !(adds && pair.adds) => {
                    return Some(PlanError::FieldFedTwice {
                        input: format!("{}.{}", plan.input_name(own.to), element_at(descriptor, at)),
                        first: plan.links[first].name.clone(),
                        second: own.name.clone(),
                    });
                }
                _ => fed[at] = Some((link, pair.adds)),
            }
        }
    }
    None
}

/// The fields, or elements of them, that no link feeds.
fn unfed_elements(descriptor: &Descriptor, fed: &[ElementSource]) -> Vec<String> {
    let mut unfed = Vec::new();
    for field in descriptor.fields.iter().filter(|field| !field.is_padding()) {
        let starts = field.range().step_by(field.element.size()).enumerate();
        let missing: Vec<usize> = starts
            .filter(|&(_, at)| fed[at].is_none())
            .map(|(index, _)| index)
            .collect();
        if missing.len() == field.len() {
            unfed.push(field.name.clone());
        } else {
            unfed.extend(missing.into_iter().map(|index| field.element_name(index)));
        }
    }
    unfed
}

/// The name of the element that starts at byte `at`.
fn element_at(descriptor: &Descriptor, at: usize) -> String {
    let field = descriptor.fields.iter().find(|field| field.range().contains(&at));
    let name = |field: &Field| field.element_name((at - field.offset as usize) / field.element.size());
    field.map(name).unwrap_or_default()
}
