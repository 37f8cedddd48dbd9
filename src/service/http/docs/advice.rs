//! What the codes mean and what to do about them. The compiler sees to it that none is left out.

use super::super::problem::Code;

/// What a code means, and what its reader can do.
pub fn of(code: Code) -> &'static str {
    match code {
        Code::InvalidJson => "The text is not JSON; `detail` has line and column. Correct it there.",
        Code::InvalidBody => "The connection broke, or the body's framing is wrong. Send the request again.",
        Code::InvalidPath => "An id has not the form of ids. Take ids from answers of the server.",
        Code::InvalidQuery => "`detail` names the parameter. Correct it, or leave it out.",
        Code::InvalidHeader => "`detail` names the header and its form. Correct it, or leave it out.",
        Code::KeyRequired => {
            "Send `Authorization: Bearer KEY`, or sign in to the dashboard. Whoever runs the server makes keys: \
             `gridfall keys create`."
        }
        Code::KeyRefused => {
            "`detail` says whether the key is out of form, unknown, expired or revoked. Whoever runs the server makes \
             and renews keys: `gridfall keys`."
        }
        Code::InsufficientScope => "`detail` names the scope that is missing. Ask for a key that has it.",
        Code::QuotaExceeded => {
            "`detail` names the quota, its value and what is used of it. Make room or wait, or ask whoever runs the \
             server for more: `gridfall keys limit`."
        }
        Code::ForeignOrigin => {
            "A browser sent this for a page of another origin. Name that origin to the server if it may change \
             things here: `gridfall serve --cors-origin`."
        }
        Code::UnknownHost => {
            "The header `Host` has a name that the server was not told of. Use its address, or tell it the name: \
             `gridfall serve --allow-host`."
        }
        Code::PreconditionFailed => "It has changed since the version in `If-Match`. Read it again, and decide anew.",
        Code::SceneNotFound => "No scene with this id was kept here. Send it with `POST /v1/scenes`.",
        Code::MaterialNotFound => {
            "No preset has this name. `GET /v1/materials` lists them; `detail` may know a near one."
        }
        Code::UnsupportedEncoding => {
            "Send the body as it is, or in an encoding that the header `Accept-Encoding` of the answer names."
        }
        Code::DiskLow => "The disk of the server is nearly full. Delete jobs that are no longer needed, or make room.",
        Code::RouteNotFound => "The address is wrong. `/openapi.json` and `/docs` have all paths.",
        Code::JobNotFound => "The id is wrong, or the job was deleted. `GET /v1/jobs` lists the jobs that there are.",
        Code::SweepNotFound => {
            "The id is wrong, or all jobs of the sweep were deleted. Submitting a sweep answers its id."
        }
        Code::WebhookNotFound => "The id is wrong, or the webhook was deleted. `GET /v1/webhooks` lists all.",
        Code::DeliveryNotFound => {
            "The id is wrong, or the delivery is old: those that arrived are kept for a week, those given up for a \
             month. `GET /v1/webhooks/ID/deliveries` lists all."
        }
        Code::WebhookDisabled => {
            "Its receiver answered 410, which means that it wants nothing more. Delete the webhook, and add it anew \
             once the receiver is there."
        }
        Code::WebhookRefused => {
            "`detail` says what is wrong with the address. Machines of the server's own network are called only if \
             its operator allows it: `gridfall serve --allow-webhook-address`."
        }
        Code::CostExceeded => {
            "The run is estimated to take longer than `max_cost` allows. Allow more, or coarsen or shorten the scene."
        }
        Code::AssetNotFound => "The file was never uploaded here. Upload it with `PUT /v1/assets`.",
        Code::OutputNotFound => {
            "The job waits, has not come that far, or ended before it wrote this. Look at its `status`, and try \
             again while it is `queued` or `running`."
        }
        Code::MethodNotAllowed => "The header `Allow` lists the methods of the path. Use one of them.",
        Code::RequestTimeout => "The body came too slowly. Send it again over a faster connection.",
        Code::JobNotFinished => {
            "Only jobs that have ended can be deleted, and only their recordings are complete. Cancel the job, wait \
             for its end, or ask for the recording so far."
        }
        Code::JobEnded => "Only jobs that wait or run can be watched live. Open the recording instead.",
        Code::WebsocketExpected => {
            "Viewers open this address over Foxglove's WebSocket protocol (`ws://`); `detail` says what is missing. \
             Other programs take the recording, or follow it with `?follow=true`."
        }
        Code::BodyTooLarge => {
            "`detail` has the limit. Upload meshes and points as assets instead of writing them into the scene; \
             decimate what is still too large."
        }
        Code::UnsupportedMediaType => "Send the header `Content-Type: application/json`.",
        Code::RangeNotSatisfiable => "The range begins behind the file's end. `Content-Range` has the file's length.",
        Code::InvalidRequest => {
            "The JSON has a field that is missing, unknown or of another type; `detail` names it. `/docs` has the \
             form of each request."
        }
        Code::InvalidAsset => {
            "`detail` says what is wrong with the file. Send a mesh (STL, OBJ, PLY, glTF in one file) or points \
             (PLY, npz) as they are, not in a form or an archive."
        }
        Code::InvalidScene => {
            "`faults` has all that is wrong with the scene: for each the place as a JSON pointer, the reason and \
             what to change. The schema at `/v1/schema/scene` finds many of them while you type."
        }
        Code::InvalidMaterial => {
            "`faults` has all that is wrong with the material or its test: for each the place as a JSON pointer, the \
             reason and what to change."
        }
        Code::InvalidRecording => {
            "The upload is no recording of Gridfall, or not its beginning. Send its first MiB, or all of it."
        }
        Code::IdempotencyKeyReused => {
            "Another request was accepted under this `Idempotency-Key`. Take a new key for each new request, and \
             the old one only to repeat a request as it was."
        }
        Code::QueueFull => "As many jobs wait as the server keeps. Try again after `Retry-After` seconds.",
        Code::Internal => "A fault of the server. Its log has the details; report them.",
        Code::Overloaded => {
            "Too many requests at once, or one that took too long. Try again after `Retry-After` seconds."
        }
        Code::DatabaseAway => {
            "The database that keeps the jobs does not answer. Jobs that run go on. Try again after `Retry-After` \
             seconds; send a submission again under the same `Idempotency-Key`."
        }
        Code::StorageAway => {
            "The object storage, where the outputs of jobs are, does not answer. Jobs that run go on, and publish \
             their outputs when it is back. Try again after `Retry-After` seconds."
        }
        Code::NoObjectStorage => {
            "There are links only to an object storage (`gridfall serve --files`). Download from this server."
        }
        Code::NotReady => "`checks` says which part cannot work and why. Wait, or see to that part.",
    }
}

/// Codes of jobs that failed (`failure.code`), and what they mean. Their `message` has the details.
pub const FAILURES: &[(&str, &str)] = &[
    ("capacity", "The run needs more memory than the device has. Raise `dx`, or run it on another device."),
    (
        "crashed",
        "The server died again and again while it ran the job. Look at its log and memory; make the scene smaller.",
    ),
    ("deadline", "No worker was free before the job's `deadline`. Give it more time or a higher `priority`."),
    ("device_lost", "The GPU stopped answering more than once. Look at the driver's log; run on the CPU."),
    (
        "diverged",
        "A quantity is no longer a number, or a step did not converge. Lower `solver.cfl` or `solver.max_dt`, or \
         look for a material or a speed that cannot be.",
    ),
    ("internal", "A fault of Gridfall. The server's log has the details; report them with the scene."),
    (
        "invalid_scene",
        "The scene was valid when it was accepted, but is not for this version or machine. Submit it again to see why.",
    ),
    ("left_domain", "Particles left the domain. Enlarge it, close its walls, or lower the step."),
    ("no_device", "There is no device that can run the scene. `/readyz` says what was found."),
    ("output", "An output could not be written. Make room on the disk, and submit the scene again."),
    ("unsupported", "The device cannot run this scene. The message says why, and what it can run."),
    ("vessel_full", "Sources emit into a vessel that has no room left. Stop them earlier, or enlarge it."),
];
