//! Packs, networks, settings files and requests.

use onecycle::{DesignRequest, Request};
use onecycle_lab::experiments::{Campaign, HonestyCampaign, Recipe, RecordingCampaign};
use onecycle_lab::learn::onnx;
use onecycle_onboard::pack::{HEADER, MAGIC, Pack, VERSION, content_hash};
use onecycle_onboard::signature::LENGTH;

/// A pack behind a head that fits it; one that is accepted can be used.
pub(crate) fn pack(bytes: &[u8]) {
    let _ = Pack::read(bytes);
    let body = match bytes.starts_with(&MAGIC) {
        true => bytes.get(HEADER..).unwrap_or_default(),
        false => bytes,
    };
    let Ok(length) = u32::try_from(HEADER + body.len()) else {
        return;
    };
    let mut whole = MAGIC.to_vec();
    whole.extend(VERSION.to_le_bytes());
    whole.extend(length.to_le_bytes());
    whole.extend(content_hash(body).to_le_bytes());
    whole.extend(body);
    if let Ok(pack) = Pack::read(&whole) {
        let _ = pack.self_test();
        let _ = pack.outputs(&[0.5; LENGTH]);
        let _ = pack.sizes();
    }
}

/// A network.
pub(crate) fn onnx(bytes: &[u8]) {
    if let Err(error) = onnx::import(bytes) {
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}

/// A campaign or a recipe in TOML.
pub(crate) fn recipe(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    let _ = toml::from_str::<Campaign>(text).map(|campaign| campaign.validate());
    let _ = toml::from_str::<RecordingCampaign>(text).map(|campaign| campaign.validate());
    let _ = toml::from_str::<HonestyCampaign>(text).map(|campaign| campaign.validate());
    let _ = toml::from_str::<Recipe>(text).map(|recipe| recipe.validate());
}

/// A request as JSON, or its settings as lines `NAME=VALUE`. What is refused is refused in one sentence.
pub(crate) fn request(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    if let Ok(request) = serde_json::from_str::<Request>(text) {
        let _ = request.specification();
    }
    let (mut request, mut design) = (Request::default(), DesignRequest::default());
    for line in text.lines() {
        if let Some((name, value)) = line.split_once('=') {
            for set in [request.set(name, value), design.set(name, value)] {
                if let Err(error) = set {
                    assert!(!error.to_string().contains('\n'), "{error}");
                }
            }
        }
    }
    for made in [request.specification(), design.specification()] {
        if let Err(error) = made {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
}
